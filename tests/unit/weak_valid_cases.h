/* What the weak form refuses alike in either core: included by the tests of each, which define the objects `own`,
 * `theta`, `model` and `design` and the functions declared here. */
#ifndef WEAK_VALID_CASES_H
#define WEAK_VALID_CASES_H

/* A valid design, of tables in `own` that a case may spoil. */
static void start_again(void);

/* The status that pvid_weak_valid_f32 or pvid_weak_valid_q31 returns for the design. */
static pvid_status validity(void);

#define GIVES(change, status)                                                                                          \
    do {                                                                                                               \
        start_again();                                                                                                 \
        change;                                                                                                        \
        assert_int_equal(validity(), status);                                                                          \
    } while (0)

/* For start_again: what has the same name in both cores. */
static void point_at_own(void)
{
    model.signal = own.signal;
    model.jet = own.jet;
    model.channel = own.channel;
    model.term = own.term;
    model.kind = own.kind;
    model.model = &theta;
    design.model = &model;
    design.noise = own.noise;
    design.error_order = own.order;
    design.error_variance = own.variance;
}

static void what_either_core_refuses(void **state)
{
    GIVES((void)0, PVID_OK);
    GIVES(design.model = NULL, PVID_BAD_MODEL);
    GIVES(model.samples = 0, PVID_BAD_MODEL);
    GIVES(model.samples = PVID_MAX_SAMPLES + 1, PVID_BAD_MODEL);
    GIVES(model.signals = 0, PVID_BAD_MODEL);
    GIVES(model.jets = 0, PVID_BAD_MODEL);
    GIVES(model.gains = 0, PVID_BAD_MODEL);
    GIVES(model.gains = PVID_MAX_CHANNELS, PVID_OK);
    GIVES(model.gains = PVID_MAX_CHANNELS + 1, PVID_BAD_MODEL);
    GIVES(model.integrands = PVID_MAX_INTEGRANDS + 1, PVID_BAD_MODEL);
    GIVES(model.channels = 0, PVID_BAD_MODEL);
    GIVES(model.kinds = 0, PVID_BAD_MODEL);
    GIVES(model.kinds = PVID_MAX_KINDS + 1, PVID_BAD_MODEL);
    GIVES(model.signal = NULL, PVID_BAD_MODEL);
    GIVES(model.jet = NULL, PVID_BAD_MODEL);
    GIVES(model.channel = NULL, PVID_BAD_MODEL);
    GIVES(model.term = NULL, PVID_BAD_MODEL);
    GIVES(model.kind = NULL, PVID_BAD_MODEL);
    GIVES(model.values = NULL, PVID_BAD_MODEL);
    GIVES(model.model = NULL, PVID_BAD_MODEL);
    GIVES(own.signal[1].sample = 2, PVID_BAD_MODEL);
    GIVES(own.jet[1].signal = 2, PVID_BAD_MODEL);
    GIVES(own.kind[0].thetas = 0, PVID_BAD_MODEL);
    GIVES(own.kind[0].first = 1, PVID_BAD_MODEL);
    GIVES(own.kind[0].end = 0, PVID_BAD_MODEL);
    GIVES(theta.n_kinds = 2, PVID_BAD_MODEL);
    GIVES(design.decimation = 0, PVID_BAD_DECIMATION);
    GIVES(design.decimation = PVID_MAX_DECIMATION + 1, PVID_BAD_DECIMATION);
    GIVES(design.functions = 4, PVID_OK);
    GIVES(design.functions = 3, PVID_BAD_FUNCTIONS);
    GIVES(design.functions = PVID_MAX_FUNCTIONS + 1, PVID_BAD_FUNCTIONS);
    GIVES(design.circle = NULL, PVID_BAD_DESIGN);
    GIVES(design.error_order = NULL, PVID_BAD_DESIGN);
    GIVES(design.error_variance = NULL, PVID_BAD_DESIGN);
    GIVES(design.noise = NULL, PVID_BAD_DESIGN);
}

#endif
