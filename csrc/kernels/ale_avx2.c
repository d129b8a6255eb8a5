/* SPDX-License-Identifier: MIT */
#define BD_LEVEL avx2
#include "kernels/ale_loops.h"
