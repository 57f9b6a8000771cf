#include "pattern_f32.h"

void pvid_pattern_transpose_times_f32(const pvid_model_f32 *model, const float c[], const float x[], float out[])
{
    for (size_t a = 0; a < model->n_p; a++) {
        out[a] = 0.0f;
    }
    for (size_t k = 0; k < model->n_c; k++) {
        out[model->c_column[k]] += c[k] * x[model->c_row[k]];
    }
}

/* t[n] += M e_j a. Above the diagonal the entries of column j stand n - 1, n - 2, .. apart; from it
 * on they are row j, one after the other. */
static void add_column(size_t n, const float m[], size_t j, float a, float t[])
{
    const float *entry = &m[j];
    for (size_t i = 0; i < j; i++) {
        t[i] += *entry * a;
        entry += (n - 1u) - i;
    }
    for (size_t i = j; i < n; i++) {
        t[i] += *entry * a;
        entry++;
    }
}

void pvid_pattern_project_row_f32(const pvid_model_f32 *model, const float c[], const float m[], size_t a, float s[])
{
    float t[PVID_MAX_THETA] = {0.0f}; /* M c_a */
    size_t k = 0;
    while ((k < model->n_c) && (model->c_column[k] < a)) {
        k++;
    }
    const size_t first = k;
    while ((k < model->n_c) && (model->c_column[k] == a)) {
        add_column(model->n_theta, m, model->c_row[k], c[k], t);
        k++;
    }
    for (size_t b = a; b < model->n_p; b++) {
        s[b] = 0.0f;
    }
    for (k = first; k < model->n_c; k++) {
        s[model->c_column[k]] += c[k] * t[model->c_row[k]];
    }
}

float pvid_pattern_times_f32(size_t n, const float m[], size_t i, const float x[])
{
    const float *entry = &m[i];
    float sum = 0.0f;
    for (size_t j = 0; j < i; j++) {
        sum += *entry * x[j];
        entry += (n - 1u) - j;
    }
    for (size_t j = i; j < n; j++) {
        sum += *entry * x[j];
        entry++;
    }
    return sum;
}
