/* SPDX-License-Identifier: MIT
 *
 * The linear algebra of the implicit methods at one instruction level; see linear.c.
 */
#include <math.h>
#include <string.h>

#include "internal.h"
#include "simd.h"

#include "ring_impl.h"

#include "tangent_impl.h"
