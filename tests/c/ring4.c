/* SPDX-License-Identifier: MIT
 *
 * The ring of kernels/ring.h with 4 unknowns a node, at one instruction level (BD_LEVEL): for
 * test_kernels.c, for no belt has as many yet.
 */
#include <math.h>
#include <string.h>

#include "kernels/kernels.h"
#include "kernels/vector.h"

#include "kernels/ring.h"

RING(four, 4, 0)

extern const bd_newton_kernels PASTE(bd_ring4_, BD_LEVEL);
const bd_newton_kernels PASTE(bd_ring4_, BD_LEVEL) = {RING_MEMORY(4), .factor = factor_four,
                                                      .solve = solve_four};
