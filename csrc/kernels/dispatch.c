/* SPDX-License-Identifier: MIT
 *
 * Which kernel level runs: the best the processor has, or the one BELTDYN_KERNELS names; NULL if
 * the processor does not have that one. Asked when a model is made; nothing is cached, so nothing
 * is global.
 */
#include <stdlib.h>
#include <string.h>

#include "kernels/kernels.h"

#ifdef BD_X86_LEVELS
extern const bd_kernels bd_kernels_avx2[], bd_kernels_avx512[];
#endif

const bd_kernels *bd_kernels_choose(void) {
  const bd_kernels *found[3];
  int n = 0;
#ifdef BD_X86_LEVELS
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    found[n++] = bd_kernels_avx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    found[n++] = bd_kernels_avx2;
  }
#endif
  found[n++] = bd_kernels_baseline;
  const char *wanted = getenv("BELTDYN_KERNELS");
  if (!wanted || !*wanted) {
    return found[0];
  }
  for (int k = 0; k < n; ++k) {
    if (strcmp(found[k]->level, wanted) == 0) {
      return found[k];
    }
  }
  return NULL;
}

const char *bd_kernel_level(void) {
  const bd_kernels *kernels = bd_kernels_choose();
  return kernels ? kernels->level : "none";
}
