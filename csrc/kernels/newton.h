/* SPDX-License-Identifier: MIT
 *
 * The linear algebra of the implicit methods at one instruction level; see solvers/newton_system.c.
 */
#include <math.h>
#include <string.h>

#include "kernels/kernels.h"
#include "kernels/vector.h"

#include "kernels/laws.h"
#include "kernels/normal_force.h"

#include "kernels/ring.h"

#include "kernels/jacobian.h"
