/* record_weak_q31: any estimate in any format saved; any bytes loaded, by an identifier of four parameters. The
 * record's bytes are of its own proof, init of others. */
#include "contracts.h"
#include "prove.h"

#include "persist/record.h"
#include "pvid/record_weak_q31.h"

/*@ requires \valid(row);
    assigns row->value, row->error, row->correlation[0 .. PVID_MAX_P - 1] \from record[0 .. 15], n_p, a;
    ensures \initialized(&row->value) && \initialized(&row->error);
    ensures \initialized(&row->correlation[0 .. PVID_MAX_P - 1]); */
void pvid_record_get(const uint8_t record[], uint8_t n_p, uint8_t a, pvid_record_row *row);

/*@ assigns \result \from record[0 .. 15], length, n_p, mechanism; */
pvid_record_status pvid_record_inspect(const uint8_t record[], size_t length, uint8_t n_p, uint32_t mechanism);

/*@ requires \initialized(&row->value) && \initialized(&row->error);
    assigns \result, *writer, record[0 .. 15] \from *writer, n_p, mechanism, *row; */
pvid_record_status pvid_record_put(pvid_record_writer *writer, uint8_t n_p, uint32_t mechanism,
                                   const pvid_record_row *row, uint8_t record[]);

/*@ assigns \result, *estimate, *number \from self->trust.copy;
    ensures \initialized(&estimate->p[0 .. PVID_MAX_P - 1]) && \initialized(&estimate->se[0 .. PVID_MAX_P - 1]);
    ensures \initialized(&estimate->correlation[0][0 .. PVID_MAX_P - 1]);
    ensures \initialized(&estimate->correlation[1][0 .. PVID_MAX_P - 1]);
    ensures \initialized(&estimate->correlation[2][0 .. PVID_MAX_P - 1]);
    ensures \initialized(&estimate->correlation[3][0 .. PVID_MAX_P - 1]);
    ensures \result == 0 || \result == 1;
    ensures \initialized(&estimate->standing.state); */
bool pvid_weak_read_q31(const pvid_weak_q31 *self, pvid_estimate_q31 *estimate, uint32_t *number);

/*@ assigns \result \from *self, *config, layout; */
pvid_status pvid_weak_init_layout_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config, uint32_t layout);

static pvid_weak_q31 identifier;
static pvid_weak_config_q31 weak_config;
static pvid_weak_design_q31 weak_design;
static pvid_weak_model_q31 weak_model;
static const pvid_model_q31 model = {.n_theta = 8, .n_p = 4};
static uint8_t bytes[PVID_RECORD_BYTES(4)];

void main(void)
{
    Frama_C_make_unknown((char *)&identifier, sizeof identifier);
    Frama_C_make_unknown((char *)bytes, sizeof bytes);
    weak_design.model = &weak_model;
    weak_model.model = &model;
    weak_config.design = &weak_design;
    identifier.design = &weak_design;
    identifier.estimator.settings.n_p = 4;
    for (size_t a = 0; a < 4u; a++) {
        identifier.estimator.settings.p_bits[a] = (int8_t)any_i32(-64, 64);
        weak_config.estimator.p_bits[a] = (int8_t)any_i32(-64, 64);
        weak_config.estimator.lower[a] = any_i32(INT32_MIN, INT32_MAX);
        weak_config.estimator.upper[a] = any_i32(INT32_MIN, INT32_MAX);
    }
    pvid_record_writer writer = {any_u32(0, UINT32_MAX), 0, (uint8_t)any_u32(0, 255)};
    (void)pvid_record_save_weak_q31(&identifier, &writer, any_u32(0, UINT32_MAX), bytes, any_u32(0, sizeof bytes));
    (void)pvid_record_load_weak_q31(&identifier, &weak_config, any_u32(0, UINT32_MAX), bytes, any_u32(0, sizeof bytes));
}
