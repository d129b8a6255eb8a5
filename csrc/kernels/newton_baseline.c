/* SPDX-License-Identifier: MIT */
#define BD_LEVEL baseline
#define BD_WIDTH 2
#include "kernels/newton.h"
