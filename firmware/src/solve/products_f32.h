/* Rows of a kind that are added together: from their products, which the caller forms. For models without their own
 * accumulate. Private to the core. */
#ifndef PVID_PRODUCTS_F32_H
#define PVID_PRODUCTS_F32_H

#include "solve/kinds.h"
#include "solve/state_f32.h"

/* sum of x y over n entries */
float pvid_product_f32(const float x[], const float y[], size_t n);

/* Accepts rows by the sum of squares of each of the n entries of N, and of e, or counts them as rejected, once. */
pvid_reason pvid_products_accept_f32(pvid_estimator_f32 *self, size_t n, const float squares[], float rss);

/* Behind the products of N with N and e, which the caller has added to `low` of the sums: the rest of what
 * pvid_estimator_add_kind_f32 does, for so many rows. gradient[block->n]: sum N e. */
void pvid_products_end_f32(pvid_estimator_f32 *self, const pvid_block *block, const float gradient[], float rss,
                           uint32_t rows);

#endif
