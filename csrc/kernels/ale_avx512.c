/* SPDX-License-Identifier: MIT */
#define BD_LEVEL avx512
#include "kernels/ale_loops.h"
