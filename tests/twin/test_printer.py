"""The translator from C to numpy: C by C, compiled beside printed, and what it refuses."""

import ctypes
import subprocess
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from pvid.core.host_compiler import host_compiler
from pvid.twin.printer.directives import UntranslatedError
from pvid.twin.printer.program import loaded, text_of

HEAD = """
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
"""


def text(code: str, **macros: str) -> str:
    return text_of([], [], macros, texts={"one.c": HEAD + code})


def printed(code: str, **macros: str) -> ModuleType:
    return loaded(text(code, **macros), "one.py")


@pytest.fixture
def compiled(tmp_path: Path) -> Any:
    """Compiles C and loads it."""

    def made(code: str) -> ctypes.CDLL:
        (tmp_path / "one.c").write_text(HEAD + code)
        command = [host_compiler("a test"), "-std=c99", "-O1", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run([*command, str(tmp_path / "one.c"), "-o", str(tmp_path / "one.so")], check=True)
        return ctypes.CDLL(str(tmp_path / "one.so"))

    return made


ARITHMETIC = """
uint32_t wraps(uint32_t a, uint32_t b) { return (a * b) + ((a - b) << 3u) - (b >> 5u); }
int32_t narrows(int32_t a, int32_t b) { return (int8_t)a + (int16_t)(uint16_t)(a + b) + (uint8_t)b; }
int32_t divides(int32_t a, int32_t b) { return (b == 0) ? 0 : ((a / b) ^ (a % b)); }
uint32_t turns(int32_t a, int32_t b) { return ~(uint32_t)a ^ -(uint32_t)b ^ ((uint32_t)a & (uint32_t)b); }
int32_t compares(int32_t a, int32_t b) { return ((a < b) == (b > a)) + (a != b) * 2 + !(a && b) * 4 + ((a | b) > 0); }
int32_t long_way(int32_t a, int32_t b) { return (int32_t)((((int64_t)a * b) + ((int64_t)1 << 30)) >> 31); }
uint32_t counts(uint32_t a, uint32_t b)
{
    uint8_t small = (uint8_t)a;
    uint16_t middle = (uint16_t)b;
    small++;
    middle -= 3u;
    small += (uint8_t)b;
    small ^= 5u;
    middle <<= 2u;
    return ((uint32_t)middle << 8) | small;
}
uint32_t walks(uint32_t a, uint32_t b)
{
    uint32_t sum = 0;
    for (uint32_t left = a % 9u; left > 0u; left--) {
        if ((left % 3u) == 0u) {
            continue;
        }
        sum += left * b;
    }
    for (uint32_t i = 1; i < (b % 50u); i += i) {
        if (i == 8u) {
            continue;
        }
        sum = (sum * 3u) + i;
    }
    do {
        sum++;
    } while ((sum % 4u) != 0u);
    switch (a % 5u) {
    case 0:
    case 3:
        sum += 100u;
        break;
    case 1: {
        return sum;
    }
    default:
        sum ^= a;
        break;
    }
    return sum;
}
"""


@pytest.mark.parametrize("name", ["wraps", "narrows", "divides", "turns", "compares", "long_way", "counts", "walks"])
def test_integers_have_the_values_of_c(name: str, compiled: Any) -> None:
    module, library = printed(ARITHMETIC), compiled(ARITHMETIC)
    signed = name in ("narrows", "divides", "turns", "compares", "long_way")
    own = getattr(library, name)
    own.restype = ctypes.c_uint32 if name in ("wraps", "turns", "counts", "walks") else ctypes.c_int32
    kind = ctypes.c_int32 if signed else ctypes.c_uint32
    random = np.random.default_rng(1)
    edges = [0, 1, 2, 3, 7, 255, 256, 65535, 65536, 2**31 - 2**20]
    pairs = [(a, b) for a in edges for b in edges]
    pairs += [(int(a), int(b)) for a, b in random.integers(0, 2**30, (200, 2))]
    pairs += [(-a, b) for a, b in pairs[:60]] + [(a, -b) for a, b in pairs[60:120]] if signed else []
    for a, b in pairs:
        assert getattr(module, name)(a, b) == own(kind(a), kind(b)), (a, b)


MEMORY = """
#define WIDTH 4
typedef struct { float x[3][WIDTH]; uint16_t count; struct { float a; bool on; } part; } thing;
typedef struct { const thing *things; float (*rows)[WIDTH]; } list;

static void add(float *to, const float from[], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        to[i] += from[i];
    }
}
static float *row(thing *self, size_t i) { return self->x[i]; }
static void up(uint16_t *count, float *also) { (*count)++; *also = *also + 1.0f; }
static thing twice(thing one)
{
    one.x[0][0] = one.x[0][0] * 2.0f;
    return one;
}
void run(const float in[12], float out[12])
{
    thing one = {.count = 65535u, .part = {1.5f, true}};
    memcpy(one.x, in, sizeof one.x);
    add(one.x[1], &one.x[0][2], 3);       /* beyond the end of a row, into the next */
    add(row(&one, 2), one.x[1], WIDTH);
    float *last = row(&one, 2);
    last = &last[1];
    last[2] -= *last;
    up(&one.count, &one.x[1][3]);
    up(&one.count, &one.part.a);
    const thing copy = one;
    one = twice(one);
    thing two[2] = {copy, one};
    list all = {two, two[1].x};
    add(out, copy.x[0], 3u * WIDTH);
    out[0] += all.things[1].x[0][0] + all.rows[2][3] + (float)one.count + (copy.part.on ? copy.part.a : 0.0f);
    memset(two[0].x[1], 0, 2u * sizeof two[0].x[0]);
    out[1] += all.things[0].x[1][0] + all.things->x[0][1];
    const float *either = (in[0] > 0.0f) ? &in[2] : two[1].x[1];
    out[2] = either[1];
}
"""


def test_pointers_structs_and_copies_have_the_bits_of_c(compiled: Any) -> None:
    module, library = printed(MEMORY), compiled(MEMORY)
    random = np.random.default_rng(2)
    for _ in range(20):
        given = random.standard_normal(12).astype(np.float32)
        own = np.zeros(12, np.float32)
        library.run(given.ctypes.data_as(ctypes.c_void_p), own.ctypes.data_as(ctypes.c_void_p))
        found = [np.float32(0)] * 12
        module.run(list(given), found)
        assert np.array(found, np.float32).tobytes() == own.tobytes()


FLOATS = """
float f(float a, float b) { return (((a * 0.1f) + (b / 3.0f)) - (a * b)) + 16777217.0f * -1.17549435e-38f; }
int32_t order(float a, float b) { return (a < b) + 2 * (a <= b) + 4 * !(a >= b) + 8 * (a == b) + 16 * (a != b); }
float of_int(int32_t n) { return (float)n; }
float bits(float x)
{
    uint32_t word;
    memcpy(&word, &x, sizeof word);
    word ^= 0x80000000u;
    float back;
    memcpy(&back, &word, sizeof back);
    return back;
}
"""


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_floats_have_the_bits_of_c_also_without_a_value(compiled: Any) -> None:
    module, library = printed(FLOATS), compiled(FLOATS)
    for one in (library.f, library.of_int, library.bits):
        one.restype = ctypes.c_float
    f32 = np.float32
    values = [f32(x) for x in (0, -0.0, 1, -2.5, 1e-45, 3e38, np.inf, -np.inf, np.nan, 0.1, 16777217)]
    for a in values:
        assert f32(library.bits(ctypes.c_float(float(a)))).tobytes() == f32(module.bits_(a)).tobytes()
        for b in values:
            own, found = f32(library.f(ctypes.c_float(float(a)), ctypes.c_float(float(b)))), module.f(a, b)
            assert own.tobytes() == found.tobytes() or (np.isnan(own) and np.isnan(found))
            assert library.order(ctypes.c_float(float(a)), ctypes.c_float(float(b))) == module.order(a, b)
    for n in (0, 16777217, 33554435, 2**31 - 1, -(2**31) + 129):
        assert f32(library.of_int(n)) == module.of_int(n)


def test_a_float_literal_is_rounded_once() -> None:
    """0.1f rounds to a double first in Python; of this one the nearest float32 is another."""
    code = "float f(void) { return 1.00000017881393432617187499f; }"
    assert printed(code).f().view(np.uint32) == 0x3F800001
    assert np.float32(float("1.00000017881393432617187499")).view(np.uint32) == 0x3F800002


def test_macros_enumerators_and_comments_keep_their_names_and_words() -> None:
    code = """
    #define LARGEST 3.0f /* of all */
    #define COUNT(exact, n) ((EXACT != 0) ? (exact) : (n))
    enum { FIRST, SECOND = 5 };
    /* What it does:
     * one thing. */
    float f(float x, uint32_t n)
    {
        /* before a statement */
        const uint32_t all = COUNT(3u, n); /* behind one */
        return (all == (uint32_t)SECOND) ? LARGEST : x;
    }
    """
    plain, exact = text(code, EXACT="0"), text(code, EXACT="1")
    assert "LARGEST = f32(3.0)" in plain and "SECOND = 5" in plain and "FIRST" not in plain
    assert '    """What it does:\n    one thing.\n    """' in plain
    assert "    # before a statement\n    all = n  # behind one\n" in plain
    assert "    all = 3  # behind one" in exact
    assert "return LARGEST if all == SECOND else x" in plain


def test_static_names_of_two_files_stay_apart() -> None:
    files = {
        "a.c": "static int step(void) { return 1; }\nint a(void) { return step(); }\n",
        "b.c": "#define K 2\nstatic int step(void) { return K; }\nint b(void) { return step(); }\n",
        "c.c": "#define K 3\nint c(void) { return K; }\n",
    }
    module = loaded(text_of([], [], {}, texts=files), "names.py")
    assert (module.a(), module.b(), module.c()) == (1, 2, 3)


def test_a_header_behind_a_static_function_of_its_source_calls_it() -> None:
    files = {
        "of.h": "static int twice(void) { return 2 * once(); }\n",
        "a.c": 'static int once(void) { return 3; }\n#include "of.h"\nint a(void) { return twice(); }\n',
    }
    assert loaded(text_of([], [], {}, texts=files), "header.py").a() == 6


@pytest.mark.parametrize(
    ("statement", "what"),
    [
        ("goto end; end: return 0;", "Goto"),
        ("return (a = 3);", "an assignment in an expression"),
        ("double x = 2; return (int)x;", "the type double"),
        ("int *p = &a; float *q = (float *)p; return (int)*q;", "a pointer to another type"),
        (
            "switch (a) { case 1: a = 2; case 2: return 3; default: break; } return 0;",
            "a case that falls into the next",
        ),
        ("return unknown(a);", "the name unknown"),
        ("a = 1, a = 2; return a;", "ExprList"),
    ],
)
def test_a_construct_without_a_translation_is_refused_with_its_place(statement: str, what: str) -> None:
    with pytest.raises(UntranslatedError, match=rf"^one\.c:8: .*{what}.* has no translation to numpy$"):
        text(f"int f(int a)\n{{\n    {statement}\n}}\n")


def test_an_error_directive_and_wrong_c_are_refused_with_their_places() -> None:
    with pytest.raises(UntranslatedError, match=r'^one\.c:7: "not so"$'):
        text('#if 1\n#error "not so"\n#endif\n')
    with pytest.raises(UntranslatedError, match=r"^one\.c:7: "):
        text("int a;\nint f( { return 1; }\n")


def test_a_function_behind_a_pointer_gets_its_offsets() -> None:
    code = """
    typedef struct { void (*f)(const float in[], float out[]); } model;
    static void twice(const float in[], float out[]) { out[0] = in[0] + in[0]; }
    const model given = {.f = twice};
    void run(const model *self, const float x[], float y[])
    {
        for (size_t i = 0; i < 3u; i++) {
            self->f(&x[i], &y[2u - i]);
        }
    }
    """
    module, y = printed(code), [np.float32(0)] * 3
    module.run(module.given, [np.float32(k) for k in range(3)], y)
    assert y == [4, 2, 0]
