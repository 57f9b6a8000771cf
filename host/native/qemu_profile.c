/* A QEMU plugin that counts how often each instruction of an image is executed inside a function and what it calls.
 *
 *   -plugin qemu_profile.so,entry=A,skip=N,caller=A,caller_end=A,base=A,bytes=N,out=FILE
 *
 * Counting begins when the instruction at `entry` is executed for the (skip + 1)th time and goes on between each such
 * call and the next instruction of the caller. FILE gets the line "calls N" and then "address count", in hexadecimal
 * and decimal, for every instruction from `base` on that was counted.
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
static const char *out;
static uint64_t *counts; /* [bytes] by address - base */
static uint64_t calls;
static bool inside;

static void executed(unsigned processor, void *place)
{
    const uint64_t address = base + (uint64_t)((uint64_t *)place - counts);
    (void)processor;
    if (address == entry) {
        calls++;
        inside = calls > skip;
    } else if ((address >= caller) && (address < caller_end)) {
        inside = false;
    }
    if (inside) {
        (*(uint64_t *)place)++;
    }
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
    for (uint64_t at = 0; at < bytes; at++) {
        if (counts[at] > 0u) {
            fprintf(file, "%" PRIx64 " %" PRIu64 "\n", base + at, counts[at]);
        }
    }
    fclose(file);
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
    }
    counts = calloc(bytes, sizeof *counts);
    if ((counts == NULL) || (out == NULL)) {
        return -1;
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
