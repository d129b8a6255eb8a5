/* SPDX-License-Identifier: MIT */
#define BD_LEVEL avx512
#define BD_WIDTH 8
#include "kernels/newton.h"
