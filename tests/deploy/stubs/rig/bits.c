/* Runs firmware/examples/commission.c, then prints its result as bits, and how far the motor went. */
#include <stdio.h>
#include <string.h>

#include "dc_motor_commission.h"
#include "rig.h"

int program(void);
int measured(void);

static void show(const char *what, float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    printf("%s %lu\n", what, (unsigned long)bits);
}

int measured(void)
{
    const int code = program();
    const pvid_commission_result_f32 *result = dc_motor_commission_result();
    for (int k = 0; k < DC_MOTOR_PARAMETERS; k++) {
        show("value", result->value[k]);
        show("error", result->error[k]);
        show("check", result->check[k]);
    }
    for (int k = 0; k < 3; k++) {
        show("largest", rig_largest(k));
    }
    return code;
}
