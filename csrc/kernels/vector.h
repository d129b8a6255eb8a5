/* SPDX-License-Identifier: MIT
 *
 * Vectors of doubles for the kernels: as wide as the instruction level that a file is compiled for;
 * two at a time with gcc and clang on any processor; elsewhere (or with BD_SCALAR) plain C, one at
 * a time. Arithmetic is written with C's operators; below is what has no operator. Compilers must
 * not fuse operators on their own (-ffp-contract=off): where a multiplication and a sum are to be
 * rounded once, fma_ or fnma_ says so, and results do not depend on the shape of the code.
 */
#ifndef BELTDYN_VECTOR_H
#define BELTDYN_VECTOR_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef __AVX2__
#include <immintrin.h>
#elif defined(__SSE2__)
#include <xmmintrin.h>
#endif

#define PASTE2(a, b) a##b
#define PASTE(a, b) PASTE2(a, b)

#if !defined(__GNUC__) || defined(BD_SCALAR)
#define INLINE static inline
enum { WIDTH = 1 };
typedef double vec;
typedef uint64_t bits;
#else
#define INLINE static inline __attribute__((always_inline))
#ifdef __AVX512F__
enum { WIDTH = 8 };
#elif defined(__AVX2__)
enum { WIDTH = 4 };
#else
enum { WIDTH = 2 };
#endif
typedef double vec __attribute__((vector_size(8 * WIDTH)));
typedef uint64_t bits __attribute__((vector_size(8 * WIDTH)));
#endif

/* From one to the other, numbers too small to be normal are 0, on processors that take a hundred
 * times as long for them. */
INLINE unsigned flush_small_numbers(void) {
#ifdef __SSE2__
  const unsigned kept = _mm_getcsr();
  _mm_setcsr(kept | 0x8040u);
  return kept;
#else
  return 0;
#endif
}

INLINE void restore_small_numbers(unsigned kept) {
#ifdef __SSE2__
  _mm_setcsr(kept);
#else
  (void)kept;
#endif
}

/* Aligned, as every block of the state is. To compilers a vector is so many doubles: storing it
 * changes no pointer and no count, which loops would have to fetch again. */
INLINE vec load(const double *p) {
  return *(const vec *)p;
}

INLINE vec load_unaligned(const double *p) {
  vec out;
  memcpy(&out, p, sizeof out);
  return out;
}

INLINE void store(double *p, vec a) {
  *(vec *)p = a;
}

/* Lane l to place at[l]. */
INLINE void scatter(double *to, const ptrdiff_t *at, vec a) {
  double lanes[WIDTH];
  memcpy(lanes, &a, sizeof a);
  for (int lane = 0; lane < WIDTH; ++lane) {
    to[at[lane]] = lanes[lane];
  }
}

INLINE vec splat(double a) {
  return a - (vec){0.0};
}

INLINE bits as_bits(vec a) {
  bits out;
  memcpy(&out, &a, sizeof out);
  return out;
}

INLINE vec as_vec(bits a) {
  vec out;
  memcpy(&out, &a, sizeof out);
  return out;
}

INLINE vec magnitude(vec a) {
  return as_vec(as_bits(a) & (UINT64_MAX >> 1));
}

/* The lanes' numbers, from 0. */
INLINE vec lane_numbers(void) {
  double numbers[WIDTH];
  vec out;
  for (int lane = 0; lane < WIDTH; ++lane) {
    numbers[lane] = lane;
  }
  memcpy(&out, numbers, sizeof out);
  return out;
}

INLINE double first_of(vec a) {
  double lanes[WIDTH];
  memcpy(lanes, &a, sizeof a);
  return lanes[0];
}

/* Of all lanes, always in the same order: by halves, which depend on each other less. */
INLINE double sum(vec a) {
  double lanes[WIDTH];
  memcpy(lanes, &a, sizeof a);
  for (int half = WIDTH / 2; half > 0; half /= 2) {
    for (int lane = 0; lane < half; ++lane) {
      lanes[lane] += lanes[lane + half];
    }
  }
  return lanes[0];
}

INLINE double largest(vec a) {
  double lanes[WIDTH];
  memcpy(lanes, &a, sizeof a);
  for (int lane = 1; lane < WIDTH; ++lane) {
    lanes[0] = lanes[lane] > lanes[0] ? lanes[lane] : lanes[0];
  }
  return lanes[0];
}

/* Masks: false where a number is none. */
#if defined(__AVX512F__) && !defined(BD_SCALAR)

typedef __mmask8 mask;

INLINE mask less(vec a, vec b) {
  return _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ);
}
INLINE int any(mask m) {
  return m != 0;
}
/* a, but not b */
INLINE mask except(mask a, mask b) {
  return (mask)(a & ~b);
}
INLINE vec choose(mask m, vec a, vec b) {
  return _mm512_mask_blend_pd(m, b, a);
}
/* a, or 0 elsewhere */
INLINE vec where(mask m, vec a) {
  return _mm512_maskz_mov_pd(m, a);
}
/* a b + c with one rounding, where the level has it in hardware */
INLINE vec fma_(vec a, vec b, vec c) {
  return _mm512_fmadd_pd(a, b, c);
}
/* c - a b, likewise */
INLINE vec fnma_(vec a, vec b, vec c) {
  return _mm512_fnmadd_pd(a, b, c);
}
/* a, or b where a is smaller or none */
INLINE vec larger(vec a, vec b) {
  return _mm512_max_pd(a, b);
}
/* Each lane's neighbour in the ring: one to the left, `before` being the vector on the left ... */
INLINE vec from_left(vec before, vec a) {
  return (vec)_mm512_alignr_epi64((__m512i)a, (__m512i)before, 7);
}
/* ... and one to the right. */
INLINE vec from_right(vec a, vec after) {
  return (vec)_mm512_alignr_epi64((__m512i)after, (__m512i)a, 1);
}
/* The lanes as a ring of their own: lane l takes what lane l + n has, n a power of 2 or minus one.
 */
INLINE vec turned(vec a, const int n) {
  const __m512i all = (__m512i)a;
  switch (n) {
  case -2:
    return (vec)_mm512_alignr_epi64(all, all, 6);
  case -1:
    return (vec)_mm512_alignr_epi64(all, all, 7);
  case 1:
    return (vec)_mm512_alignr_epi64(all, all, 1);
  case 2:
    return (vec)_mm512_alignr_epi64(all, all, 2);
  default:
    return _mm512_shuffle_f64x2(a, a, 0x4e);
  }
}
/* Lane l from place at[l]. */
INLINE vec gather(const double *from, const ptrdiff_t *at) {
  return (vec){from[at[0]], from[at[1]], from[at[2]], from[at[3]],
               from[at[4]], from[at[5]], from[at[6]], from[at[7]]};
}
/* 1/sqrt(a) to 14 bits */
INLINE vec root_estimate(vec a) {
  return _mm512_rsqrt14_pd(a);
}
enum { ESTIMATE_STEPS = 1 };

#elif defined(__AVX2__) && !defined(BD_SCALAR)

typedef bits mask;

INLINE mask less(vec a, vec b) {
  return (mask)_mm256_cmp_pd(a, b, _CMP_LT_OQ);
}
INLINE int any(mask m) {
  return _mm256_movemask_pd((vec)m) != 0;
}
INLINE mask except(mask a, mask b) {
  return a & ~b;
}
INLINE vec choose(mask m, vec a, vec b) {
  return _mm256_blendv_pd(b, a, (vec)m);
}
INLINE vec where(mask m, vec a) {
  return _mm256_and_pd((vec)m, a);
}
INLINE vec fma_(vec a, vec b, vec c) {
  return _mm256_fmadd_pd(a, b, c);
}
INLINE vec fnma_(vec a, vec b, vec c) {
  return _mm256_fnmadd_pd(a, b, c);
}
INLINE vec larger(vec a, vec b) {
  return _mm256_max_pd(a, b);
}
INLINE vec from_left(vec before, vec a) {
  return _mm256_shuffle_pd(_mm256_permute2f128_pd(before, a, 0x21), a, 5);
}
INLINE vec from_right(vec a, vec after) {
  return _mm256_shuffle_pd(a, _mm256_permute2f128_pd(a, after, 0x21), 5);
}
INLINE vec turned(vec a, const int n) {
  switch (n) {
  case -1:
    return _mm256_permute4x64_pd(a, 0x93);
  case 1:
    return _mm256_permute4x64_pd(a, 0x39);
  default:
    return _mm256_permute4x64_pd(a, 0x4e);
  }
}
INLINE vec gather(const double *from, const ptrdiff_t *at) {
  return (vec){from[at[0]], from[at[1]], from[at[2]], from[at[3]]};
}
/* 1/sqrt(a) to 11 bits, for a within the range of a float; the last bits of what Newton makes of it
 * may differ between makers of processors */
INLINE vec root_estimate(vec a) {
  return _mm256_cvtps_pd(_mm_rsqrt_ps(_mm256_cvtpd_ps(a)));
}
enum { ESTIMATE_STEPS = 2 };

#elif defined(__GNUC__) && !defined(BD_SCALAR)

typedef bits mask;

INLINE mask less(vec a, vec b) {
  return (mask)(a < b);
}
INLINE int any(mask m) {
  return (m[0] | m[1]) != 0;
}
INLINE mask except(mask a, mask b) {
  return a & ~b;
}
INLINE vec choose(mask m, vec a, vec b) {
  return (vec)(((bits)a & m) | ((bits)b & ~m));
}
INLINE vec where(mask m, vec a) {
  return (vec)((bits)a & m);
}
INLINE vec fma_(vec a, vec b, vec c) {
#ifdef __FP_FAST_FMA
  return (vec){__builtin_fma(a[0], b[0], c[0]), __builtin_fma(a[1], b[1], c[1])};
#else
  return a * b + c;
#endif
}
INLINE vec fnma_(vec a, vec b, vec c) {
#ifdef __FP_FAST_FMA
  return fma_(-a, b, c);
#else
  return c - a * b;
#endif
}
INLINE vec larger(vec a, vec b) {
  return choose(less(b, a), a, b);
}
INLINE vec from_left(vec before, vec a) {
  return (vec){before[1], a[0]};
}
INLINE vec from_right(vec a, vec after) {
  return (vec){a[1], after[0]};
}
INLINE vec turned(vec a, const int n) {
  (void)n;
  return (vec){a[1], a[0]};
}
INLINE vec gather(const double *from, const ptrdiff_t *at) {
  return (vec){from[at[0]], from[at[1]]};
}
INLINE void root_and_inverse(vec a, vec *root, vec *inverse) {
  *root = (vec){sqrt(a[0]), sqrt(a[1])};
  *inverse = 1.0 / *root;
}

#else

typedef int mask;

INLINE mask less(vec a, vec b) {
  return a < b;
}
INLINE int any(mask m) {
  return m;
}
INLINE mask except(mask a, mask b) {
  return a & !b;
}
INLINE vec choose(mask m, vec a, vec b) {
  return m ? a : b;
}
INLINE vec where(mask m, vec a) {
  return m ? a : 0.0;
}
INLINE vec fma_(vec a, vec b, vec c) {
  return a * b + c;
}
INLINE vec fnma_(vec a, vec b, vec c) {
  return c - a * b;
}
INLINE vec larger(vec a, vec b) {
  return a > b ? a : b;
}
INLINE vec from_left(vec before, vec a) {
  (void)a;
  return before;
}
INLINE vec from_right(vec a, vec after) {
  (void)a;
  return after;
}
INLINE vec turned(vec a, const int n) {
  (void)n;
  return a;
}
INLINE vec gather(const double *from, const ptrdiff_t *at) {
  return from[at[0]];
}
INLINE void root_and_inverse(vec a, vec *root, vec *inverse) {
  *root = sqrt(a);
  *inverse = 1.0 / *root;
}

#endif

/* exp(a) of a <= 0, to an ulp or two; 0 to within 1e-304 below -700. a = k ln 2 + r, k the nearest
 * integer, ln 2 in two parts (fdlibm), Taylor's polynomial of exp(r) up to |r| = 0.35, and k added
 * to the exponent: adding 1.5 * 2^52 rounds, and leaves k in the lowest bits. */
INLINE vec exponential(vec a) {
#ifdef BD_COUNT_EXPONENTIALS
  extern long bd_exponentials;
  bd_exponentials += WIDTH;
#endif
  static const double inverse_factorials[] = {1.0 / 479001600.0,
                                              1.0 / 39916800.0,
                                              1.0 / 3628800.0,
                                              1.0 / 362880.0,
                                              1.0 / 40320.0,
                                              1.0 / 5040.0,
                                              1.0 / 720.0,
                                              1.0 / 120.0,
                                              1.0 / 24.0,
                                              1.0 / 6.0,
                                              1.0 / 2.0,
                                              1.0,
                                              1.0};
  const vec to_nearest = splat(6755399441055744.0); /* 1.5 * 2^52 */
  const vec bounded = larger(a, splat(-700.0));
  const vec shifted = fma_(bounded, splat(1.44269504088896338700e+00), to_nearest);
  const vec k = shifted - to_nearest;
  vec r = fma_(k, splat(-6.93147180369123816490e-01), bounded);
  r = fma_(k, splat(-1.90821492927058770002e-10), r);
  vec p = splat(1.0 / 6227020800.0);
  for (size_t j = 0; j < sizeof inverse_factorials / sizeof inverse_factorials[0]; ++j) {
    p = fma_(p, r, splat(inverse_factorials[j]));
  }
  return as_vec(as_bits(p) + (as_bits(shifted) << 52));
}

#if defined(__AVX2__) && !defined(BD_SCALAR)
/* sqrt(a) and its inverse, to an ulp, without a division: Newton's iteration on both. */
INLINE void root_and_inverse(vec a, vec *root, vec *inverse) {
  const vec half = splat(0.5);
  const vec estimate = root_estimate(a);
  vec r = a * estimate, h = half * estimate;
  for (int k = 0; k < ESTIMATE_STEPS; ++k) {
    const vec left = fma_(-r, h, half);
    r = fma_(r, left, r);
    h = fma_(h, left, h);
  }
  *root = fma_(fma_(-r, r, a), h, r);
  const vec twice = h + h;
  *inverse = fma_(fma_(-*root, twice, splat(1.0)), twice, twice);
}
#endif

#endif
