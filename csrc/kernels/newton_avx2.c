/* SPDX-License-Identifier: MIT */
#define BD_LEVEL avx2
#define BD_WIDTH 4
#include "kernels/newton.h"
