/* SPDX-License-Identifier: MIT
 *
 * What the files that are compiled once per instruction level share (BD_LEVEL names the level).
 */
#ifndef BELTDYN_SIMD_H
#define BELTDYN_SIMD_H

/* A fused multiply-add only where the level has one in hardware; contraction is off elsewhere. */
#ifdef __FP_FAST_FMA
#define FMA(a, b, c) __builtin_fma((a), (b), (c))
#else
#define FMA(a, b, c) ((a) * (b) + (c))
#endif

#if defined(__GNUC__) || defined(__clang__)
#define SPECIALISED static inline __attribute__((always_inline))
#define ALIGNED(pointer) __builtin_assume_aligned((pointer), BD_ALIGN)
#else
#define SPECIALISED static inline
#define ALIGNED(pointer) (pointer)
#endif
#define SIMD _Pragma("omp simd")

#define PASTE2(a, b) a##b
#define PASTE(a, b) PASTE2(a, b)

#endif
