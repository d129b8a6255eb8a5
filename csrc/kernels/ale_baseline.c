/* SPDX-License-Identifier: MIT */
#define BD_LEVEL baseline
#include "kernels/ale_loops.h"
