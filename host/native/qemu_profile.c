/* A QEMU plugin that counts how often each instruction of an image is executed inside a function and what it calls.
 *
 *   -plugin qemu_profile.so,entry=A,skip=N,caller=A,caller_end=A,base=A,bytes=N,functions=FILE,out=FILE
 *
 * Counting begins when the instruction at `entry` is executed for the (skip + 1)th time and goes on between each such
 * call and the next instruction of the caller. `functions` is a file with the addresses where functions begin. `out`
 * gets the lines "calls N" and "longest N", the instructions of the longest call; then "enters A B" for each
 * instruction at A behind which the function at B began; then "address count most", in hexadecimal and decimal, for
 * every instruction from `base` on that was counted: of all calls, and the most in one call of its own function.
 *
 * The distribution packs no header of QEMU's plugin interface (docs/devel/tcg-plugins); what is used of it is declared
 * here.
 */
#include <inttypes.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define PLUGIN_API_VERSION 1 /* of QEMU 4.2 .. 8.2 */
#define NO_REGISTERS 0       /* the callback neither reads nor writes the processor's */

typedef uint64_t qemu_plugin_id_t;
typedef struct qemu_info_t qemu_info_t;
typedef struct qemu_plugin_tb qemu_plugin_tb;
typedef struct qemu_plugin_insn qemu_plugin_insn;

size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb *block);
qemu_plugin_insn *qemu_plugin_tb_get_insn(const qemu_plugin_tb *block, size_t index);
uint64_t qemu_plugin_insn_vaddr(const qemu_plugin_insn *instruction);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id, void (*callback)(qemu_plugin_id_t, qemu_plugin_tb *));
void qemu_plugin_register_vcpu_insn_exec_cb(qemu_plugin_insn *instruction, void (*callback)(unsigned, void *),
                                            int registers, void *place);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, void (*callback)(qemu_plugin_id_t, void *), void *data);

EXPORT int qemu_plugin_version = PLUGIN_API_VERSION;
EXPORT int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int count, char **arguments);

static uint64_t entry, skip, caller, caller_end, base, bytes;
static const char *out, *functions;
static struct counted {
    uint64_t all, now, most; /* of all calls; of this call of its function; of the function's call with the most */
    uint64_t begin;          /* of its function, from base on */
} *counts;                   /* [bytes] by address - base */
static uint64_t calls, length, longest, last;
static bool inside;

#define MOST_ENTRIES 4096
static uint64_t from[MOST_ENTRIES], to[MOST_ENTRIES]; /* from base on */
static size_t entries;

/* A function begins, behind the instruction at `last`: no function is called while it runs, so it has one call. */
static void begin(uint64_t at)
{
    for (uint64_t k = at; (k < bytes) && (counts[k].begin == at); k++) {
        counts[k].most = (counts[k].now > counts[k].most) ? counts[k].now : counts[k].most;
        counts[k].now = 0;
    }
    size_t k = 0;
    while ((k < entries) && ((from[k] != last) || (to[k] != at))) {
        k++;
    }
    if (k == MOST_ENTRIES) {
        fputs("qemu_profile: more calls than places for them\n", stderr);
        exit(EXIT_FAILURE);
    }
    if (k == entries) {
        from[entries] = last;
        to[entries++] = at;
    }
}

static void executed(unsigned processor, void *place)
{
    struct counted *one = place;
    const uint64_t at = (uint64_t)(one - counts);
    const uint64_t address = base + at;
    (void)processor;
    if (address == entry) {
        calls++;
        inside = calls > skip;
        length = 0;
    } else if ((address >= caller) && (address < caller_end)) {
        inside = false;
    }
    if (inside) {
        if ((at == one->begin) && ((address == entry) || (counts[last].begin != at))) {
            begin(at);
        }
        one->all++;
        one->now++;
        length++;
        longest = (length > longest) ? length : longest;
    }
    last = at;
}

static void translated(qemu_plugin_id_t id, qemu_plugin_tb *block)
{
    (void)id;
    const size_t length = qemu_plugin_tb_n_insns(block);
    for (size_t i = 0; i < length; i++) {
        qemu_plugin_insn *instruction = qemu_plugin_tb_get_insn(block, i);
        const uint64_t at = qemu_plugin_insn_vaddr(instruction) - base;
        if (at < bytes) {
            qemu_plugin_register_vcpu_insn_exec_cb(instruction, executed, NO_REGISTERS, &counts[at]);
        }
    }
}

static void ended(qemu_plugin_id_t id, void *unused)
{
    (void)id;
    (void)unused;
    FILE *file = fopen(out, "w");
    if (file == NULL) {
        perror(out);
        return;
    }
    fprintf(file, "calls %" PRIu64 "\n", (calls > skip) ? (calls - skip) : 0u);
    fprintf(file, "longest %" PRIu64 "\n", longest);
    for (size_t k = 0; k < entries; k++) {
        fprintf(file, "enters %" PRIx64 " %" PRIx64 "\n", base + from[k], base + to[k]);
    }
    for (uint64_t at = 0; at < bytes; at++) {
        const struct counted *one = &counts[at];
        if (one->all > 0u) {
            const uint64_t most = (one->now > one->most) ? one->now : one->most;
            fprintf(file, "%" PRIx64 " %" PRIu64 " %" PRIu64 "\n", base + at, one->all, most);
        }
    }
    fclose(file);
}

/* The functions' first instructions; false where the file cannot be read. */
static bool read_functions(void)
{
    FILE *file = fopen(functions, "r");
    uint64_t address;
    if (file == NULL) {
        return false;
    }
    for (uint64_t at = 0; at < bytes; at++) {
        counts[at].begin = bytes;
    }
    while (fscanf(file, "%" SCNx64, &address) == 1) {
        if ((address - base) < bytes) {
            counts[address - base].begin = address - base;
        }
    }
    fclose(file);
    for (uint64_t at = 1; at < bytes; at++) {
        counts[at].begin = (counts[at].begin == bytes) ? counts[at - 1].begin : counts[at].begin;
    }
    return true;
}

int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int count, char **arguments)
{
    static const struct {
        const char *name;
        uint64_t *value;
    } numbers[] = {{"entry=", &entry},           {"skip=", &skip}, {"caller=", &caller},
                   {"caller_end=", &caller_end}, {"base=", &base}, {"bytes=", &bytes}};
    (void)info;
    for (int i = 0; i < count; i++) {
        for (size_t k = 0; k < sizeof numbers / sizeof numbers[0]; k++) {
            const size_t length = strlen(numbers[k].name);
            if (strncmp(arguments[i], numbers[k].name, length) == 0) {
                *numbers[k].value = strtoull(&arguments[i][length], NULL, 0);
            }
        }
        if (strncmp(arguments[i], "out=", 4) == 0) {
            out = strdup(&arguments[i][4]);
        }
        if (strncmp(arguments[i], "functions=", 10) == 0) {
            functions = strdup(&arguments[i][10]);
        }
    }
    counts = calloc(bytes, sizeof *counts);
    if ((counts == NULL) || (out == NULL) || (functions == NULL) || !read_functions()) {
        return -1;
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
