/* SPDX-License-Identifier: MIT
 *
 * The inner loops, compiled once per instruction level (kernels_*.c include this file with their
 * own flags and BD_LEVEL). Plain C loops over structure-of-arrays blocks, written so that a
 * compiler vectorises them: no calls, no branches, lengths padded to BD_LANES.
 *
 * Joints (2.2, MODEL section 2): d = (r_i - l0/2 e_i) - (r_{i-1} + l0/2 e_{i-1}), force on link i
 * -(c d + b d'), on link i-1 the opposite, each with its moment (2.11)_3 at the link's end.
 * Contact (2.3-2.8) and Dahl friction (2.9-2.10): MODEL sections 3 and 4.
 * Stability: |lambda| of the joints, see model.c. Guarded by tests/test_oracle.py and
 * tests/test_kernels.py (levels against each other).
 */
#include <math.h>

#include "internal.h"

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

/* sin and cos together: quadrant by the nearest multiple of pi/2, Cody-Waite reduction with three
 * 33-bit parts (exact for |k| < 2^20), then the polynomials of fdlibm on [-pi/4, pi/4]. Error below
 * 1 ulp of the result's scale. */
SPECIALISED void sine_cosine(double angle, double *sine, double *cosine) {
  const double to_nearest = 6755399441055744.0; /* 1.5 * 2^52 */
  double k = (angle * 0.63661977236758134308 + to_nearest) - to_nearest;
  double r = FMA(k, -1.57079632673412561417e+00, angle);
  r = FMA(k, -6.07710050630396597660e-11, r);
  r = FMA(k, -2.02226624871116645580e-21, r);
  double z = r * r;
  double s = FMA(z, 1.58969099521155010221e-10, -2.50507602534068634195e-08);
  s = FMA(z, s, 2.75573137070700676789e-06);
  s = FMA(z, s, -1.98412698298579493134e-04);
  s = FMA(z, s, 8.33333333332248946124e-03);
  s = FMA(z, s, -1.66666666666666324348e-01);
  s = FMA(z * r, s, r);
  double c = FMA(z, -1.13596475577881948265e-11, 2.08757232129817482790e-09);
  c = FMA(z, c, -2.75573143513906633035e-07);
  c = FMA(z, c, 2.48015872894767294178e-05);
  c = FMA(z, c, -1.38888888888741095749e-03);
  c = FMA(z, c, 4.16666666666666019037e-02);
  c = FMA(z * z, c, FMA(z, -0.5, 1.0));
  /* quadrant in {-2, -1, 0, 1, 2} */
  double q = k - 4.0 * ((k * 0.25 + to_nearest) - to_nearest);
  double odd = q * q == 1.0 ? 1.0 : 0.0;
  double sin_mag = odd != 0.0 ? c : s;
  double cos_mag = odd != 0.0 ? s : c;
  *sine = (q < 0.0 || q > 1.5) ? -sin_mag : sin_mag;
  *cosine = (q > 0.5 || q < -1.5) ? -cos_mag : cos_mag;
}

static void copy_neighbours(const bd_layout *lay, double *y) {
  for (int f = F_X; f <= F_VPHI; ++f) {
    double *v = bd_field(lay, y, f);
    v[-1] = v[lay->n - 1];
    v[lay->n] = v[0];
  }
}

/* Right ends of the links: position and velocity. */
SPECIALISED void link_ends(const bd_links *links, const double *y) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, n8 = lay->n8;
  const double half = links->half;
  const double *restrict x = ALIGNED(bd_cfield(lay, y, F_X));
  const double *restrict yy = ALIGNED(bd_cfield(lay, y, F_Y));
  const double *restrict phi = ALIGNED(bd_cfield(lay, y, F_PHI));
  const double *restrict vx = ALIGNED(bd_cfield(lay, y, F_VX));
  const double *restrict vy = ALIGNED(bd_cfield(lay, y, F_VY));
  const double *restrict vphi = ALIGNED(bd_cfield(lay, y, F_VPHI));
  double *restrict co = ALIGNED(links->cos), *restrict si = ALIGNED(links->sin);
  double *restrict rx = ALIGNED(links->rx), *restrict ry = ALIGNED(links->ry);
  double *restrict ru = ALIGNED(links->ru), *restrict rv = ALIGNED(links->rv);
  SIMD for (int i = 0; i < n8; ++i) {
    double s, c;
    sine_cosine(phi[i], &s, &c);
    const double hc = half * c, hs = half * s, w = vphi[i];
    co[i] = c;
    si[i] = s;
    rx[i] = x[i] + hc;
    ry[i] = yy[i] + hs;
    ru[i] = FMA(-hs, w, vx[i]);
    rv[i] = FMA(hc, w, vy[i]);
  }
  rx[-1] = rx[n - 1];
  ry[-1] = ry[n - 1];
  ru[-1] = ru[n - 1];
  rv[-1] = rv[n - 1];
}

/* Forces in the joints, tension along +d, and bending moments; returns the dampers' power. */
SPECIALISED double joint_forces(const bd_links *links, const double *y, const int bending,
                                const int ledger) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, n8 = lay->n8;
  const double half = links->half, stiffness = links->stiffness, damping = links->damping;
  const double *restrict x = ALIGNED(bd_cfield(lay, y, F_X));
  const double *restrict yy = ALIGNED(bd_cfield(lay, y, F_Y));
  const double *restrict phi = ALIGNED(bd_cfield(lay, y, F_PHI));
  const double *restrict vx = ALIGNED(bd_cfield(lay, y, F_VX));
  const double *restrict vy = ALIGNED(bd_cfield(lay, y, F_VY));
  const double *restrict vphi = ALIGNED(bd_cfield(lay, y, F_VPHI));
  const double *restrict co = ALIGNED(links->cos), *restrict si = ALIGNED(links->sin);
  const double *restrict rx = ALIGNED(links->rx), *restrict ry = ALIGNED(links->ry);
  const double *restrict ru = ALIGNED(links->ru), *restrict rv = ALIGNED(links->rv);
  const double *restrict live = ALIGNED(links->live);
  double *restrict fx = ALIGNED(links->fx), *restrict fy = ALIGNED(links->fy);
  double *restrict moment = ALIGNED(links->moment);
  double loss = 0.0;
  _Pragma("omp simd reduction(+ : loss)") for (int i = 0; i < n8; ++i) {
    const double hc = half * co[i], hs = half * si[i], w = vphi[i];
    const double dx = (x[i] - hc) - rx[i - 1];
    const double dy = (yy[i] - hs) - ry[i - 1];
    const double du = FMA(hs, w, vx[i]) - ru[i - 1];
    const double dv = FMA(-hc, w, vy[i]) - rv[i - 1];
    fx[i] = FMA(stiffness, dx, damping * du);
    fy[i] = FMA(stiffness, dy, damping * dv);
    if (ledger) {
      loss += live[i] * damping * FMA(du, du, dv * dv);
    }
  }
  fx[n] = fx[0];
  fy[n] = fy[0];
  if (!bending) {
    return loss;
  }
  const double ctor = links->bending, btor = links->bending_damping;
  double bend_loss = 0.0;
  _Pragma("omp simd reduction(+ : bend_loss)") for (int i = 0; i < n8; ++i) {
    const double turn = phi[i] - phi[i - 1], rate = vphi[i] - vphi[i - 1];
    moment[i] = FMA(ctor, turn, btor * rate);
    if (ledger) {
      bend_loss += live[i] * btor * rate * rate;
    }
  }
  /* the winding stands between links n-1 and 0 only */
  moment[0] += ctor * links->wind;
  moment[n] = moment[0];
  return loss + bend_loss;
}

/* (2.11) without contact: every link between its two joints. Sets all link blocks of out. */
SPECIALISED void link_rates(const bd_links *links, const double *y, double *out,
                            const int bending) {
  const bd_layout *lay = &links->lay;
  const int n8 = lay->n8;
  const double inv_mass = links->inv_mass, inv_inertia = links->inv_inertia;
  const double arm = links->half * inv_inertia;
  const double *restrict vx = ALIGNED(bd_cfield(lay, y, F_VX));
  const double *restrict vy = ALIGNED(bd_cfield(lay, y, F_VY));
  const double *restrict vphi = ALIGNED(bd_cfield(lay, y, F_VPHI));
  const double *restrict co = ALIGNED(links->cos), *restrict si = ALIGNED(links->sin);
  const double *restrict fx = ALIGNED(links->fx), *restrict fy = ALIGNED(links->fy);
  const double *restrict moment = ALIGNED(links->moment);
  const double *restrict live = ALIGNED(links->live);
  double *restrict ox = ALIGNED(bd_field(lay, out, F_X));
  double *restrict oy = ALIGNED(bd_field(lay, out, F_Y));
  double *restrict ophi = ALIGNED(bd_field(lay, out, F_PHI));
  double *restrict ovx = ALIGNED(bd_field(lay, out, F_VX));
  double *restrict ovy = ALIGNED(bd_field(lay, out, F_VY));
  double *restrict ovphi = ALIGNED(bd_field(lay, out, F_VPHI));
  SIMD for (int i = 0; i < n8; ++i) {
    ox[i] = live[i] * vx[i];
    oy[i] = live[i] * vy[i];
    ophi[i] = live[i] * vphi[i];
    ovx[i] = live[i] * inv_mass * (fx[i + 1] - fx[i]);
    ovy[i] = live[i] * inv_mass * (fy[i + 1] - fy[i]);
    double turning = arm * (co[i] * (fy[i] + fy[i + 1]) - si[i] * (fx[i] + fx[i + 1]));
    if (bending) {
      turning += inv_inertia * (moment[i + 1] - moment[i]);
    }
    ovphi[i] = live[i] * turning;
  }
  for (int f = F_MU; f < F_MU + 2 * lay->slots; ++f) {
    double *restrict o = ALIGNED(bd_field(lay, out, f));
    SIMD for (int i = 0; i < n8; ++i) {
      o[i] = 0.0;
    }
  }
}

SPECIALISED double joints(const bd_links *links, double *y, double *dy, const int bending,
                          const int ledger) {
  copy_neighbours(&links->lay, y);
  link_ends(links, y);
  const double loss = joint_forces(links, y, bending, ledger);
  link_rates(links, y, dy, bending);
  return loss;
}

SPECIALISED void contact(const bd_links *links, const bd_drum *drum, int n_runs, const bd_run *runs,
                         const double *y, double *dy, bd_sums *sums, const int friction,
                         const int ledger) {
  const bd_layout *lay = &links->lay;
  const bd_drum d = *drum;
  const double inv_mass = links->inv_mass;
  const double *restrict x = ALIGNED(bd_cfield(lay, y, F_X));
  const double *restrict yy = ALIGNED(bd_cfield(lay, y, F_Y));
  const double *restrict vx = ALIGNED(bd_cfield(lay, y, F_VX));
  const double *restrict vy = ALIGNED(bd_cfield(lay, y, F_VY));
  const double *restrict mu = ALIGNED(bd_cfield(lay, y, friction ? F_MU + d.slot : F_X));
  const double *restrict live = ALIGNED(links->live);
  double *restrict ovx = ALIGNED(bd_field(lay, dy, F_VX));
  double *restrict ovy = ALIGNED(bd_field(lay, dy, F_VY));
  double *restrict omu = ALIGNED(bd_field(lay, dy, friction ? F_MU + d.slot : F_X));
  double *restrict oslip = ALIGNED(bd_field(lay, dy, friction ? bd_f_slip(lay) + d.slot : F_Y));
  const double per_mu_k = friction ? 1.0 / d.mu_k : 0.0;
  double torque = 0.0, contact_loss = 0.0, friction_loss = 0.0;

  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    _Pragma("omp simd reduction(+ : torque, contact_loss, friction_loss)") for (int i = begin;
                                                                                i < end; ++i) {
      const double dx = x[i] - d.x, dy_ = yy[i] - d.y;
      const double rho = sqrt(FMA(dx, dx, dy_ * dy_));
      const double p = live[i] * (d.radius - rho);
      const double inv = 1.0 / rho;
      const double nx = dx * inv, ny = dy_ * inv;
      const double ux = vx[i] - d.vx, uy = vy[i] - d.vy;
      const double rate = -FMA(ux, nx, uy * ny);
      const double elastic = FMA(d.quadratic, p, d.linear) * p;
      const double raw = FMA(d.damping, rate, elastic);
      const double normal = p > 0.0 ? (raw > 0.0 ? raw : 0.0) : 0.0;
      double fx = normal * nx, fy = normal * ny;
      if (friction) {
        const double slide = FMA(uy, nx, -(ux * ny)) - d.omega * rho;
        const double touch = p > 0.0 ? 1.0 : 0.0;
        const double v = touch * slide;
        const double tangential = mu[i] * normal;
        fx = FMA(tangential, ny, fx);
        fy = FMA(-tangential, nx, fy);
        omu[i] += d.sigma * FMA(-fabs(v), mu[i] * per_mu_k, v);
        oslip[i] += v;
        torque += tangential * rho;
        if (ledger) {
          friction_loss += tangential * v;
        }
      }
      if (ledger) {
        contact_loss += p > 0.0 ? (normal - elastic) * rate : 0.0;
      }
      ovx[i] += inv_mass * fx;
      ovy[i] += inv_mass * fy;
    }
  }
  sums->torque = torque;
  sums->contact_loss = contact_loss;
  sums->friction_loss = friction_loss;
}

#define JOINTS(bending, ledger)                                                                    \
  static double joints_##bending##ledger(const bd_links *links, double *y, double *dy) {           \
    return joints(links, y, dy, bending, ledger);                                                  \
  }
#define CONTACT(friction, ledger)                                                                  \
  static void contact_##friction##ledger(const bd_links *links, const bd_drum *drum, int n_runs,   \
                                         const bd_run *runs, const double *y, double *dy,          \
                                         bd_sums *sums) {                                          \
    contact(links, drum, n_runs, runs, y, dy, sums, friction, ledger);                             \
  }
JOINTS(0, 0)
JOINTS(0, 1)
JOINTS(1, 0)
JOINTS(1, 1)
CONTACT(0, 0)
CONTACT(0, 1)
CONTACT(1, 0)
CONTACT(1, 1)

SPECIALISED double weighted_sum(size_t i, int m, const double *a, double *const *k) {
  double sum = a[0] * k[0][i];
  for (int j = 1; j < m; ++j) {
    sum = FMA(a[j], k[j][i], sum);
  }
  return sum;
}

SPECIALISED void combine_fixed(size_t n, double *restrict out, const double *restrict y, double h,
                               const int m, const double *a, double *const *k) {
  double ha[BD_MAX_STAGES];
  double *kj[BD_MAX_STAGES];
  for (int j = 0; j < m; ++j) {
    ha[j] = h * a[j];
    kj[j] = ALIGNED(k[j]);
  }
  out = ALIGNED(out);
  y = ALIGNED(y);
  SIMD for (size_t i = 0; i < n; ++i) {
    out[i] = y[i] + weighted_sum(i, m, ha, kj);
  }
}

static void combine(size_t n, double *out, const double *y, double h, int m, const double *a,
                    double *const *k) {
  switch (m) {
#define CASE(count)                                                                                \
  case count:                                                                                      \
    combine_fixed(n, out, y, h, count, a, k);                                                      \
    break
    CASE(1);
    CASE(2);
    CASE(3);
    CASE(4);
    CASE(5);
    CASE(6);
    CASE(7);
#undef CASE
  default:
    break;
  }
}

/* Raises worst[lane] to the largest squared error over [begin, end), a multiple of BD_LANES, of
 * single components or of vectors whose second component stands `pair` further on. A maximum per
 * lane is no reduction, so every compiler vectorises it; `total` goes non-finite with any error. */
SPECIALISED void worst_square(int begin, int end, const int pair, const int m, const double *e,
                              double *const *k, const double *restrict w, double *restrict worst,
                              double *restrict total) {
  for (int block = begin; block < end; block += BD_LANES) {
    SIMD for (int lane = 0; lane < BD_LANES; ++lane) {
      const int i = block + lane;
      const double one = w[i] * weighted_sum((size_t)i, m, e, k);
      double square = one * one;
      if (pair) {
        const double two = w[i] * weighted_sum((size_t)(i + pair), m, e, k);
        square = FMA(two, two, square);
      }
      worst[lane] = square > worst[lane] ? square : worst[lane];
      total[lane] += square;
    }
  }
}

SPECIALISED double error_fixed(const bd_layout *lay, double h, const int m, const double *e,
                               double *const *k, const double *restrict w) {
  double he[BD_MAX_STAGES];
  double *kj[BD_MAX_STAGES];
  for (int j = 0; j < m; ++j) {
    he[j] = h * e[j];
    kj[j] = ALIGNED(k[j]);
  }
  w = ALIGNED(w);
  const int stride = lay->stride;
  const int blocks[][2] = {{F_PHI, F_VX}, {F_VPHI, F_MU + lay->slots}};
  double worst[BD_LANES] = {0}, total[BD_LANES] = {0};
  for (int f = F_X; f <= F_VX; f += F_VX - F_X) {
    int begin = f * stride + BD_HALO;
    worst_square(begin, begin + lay->n8, stride, m, he, kj, w, worst, total);
  }
  for (int b = 0; b < 2; ++b) {
    worst_square(blocks[b][0] * stride, blocks[b][1] * stride, 0, m, he, kj, w, worst, total);
  }
  worst_square(lay->theta, (int)lay->size, 0, m, he, kj, w, worst, total);
  double largest = 0.0, sum = 0.0;
  for (int lane = 0; lane < BD_LANES; ++lane) {
    largest = worst[lane] > largest ? worst[lane] : largest;
    sum += total[lane];
  }
  return isfinite(sum) ? sqrt(largest) : INFINITY;
}

static double error_norm(const bd_layout *lay, double h, int m, const double *e, double *const *k,
                         const double *w) {
  switch (m) {
  case 1:
    return error_fixed(lay, h, 1, e, k, w);
  case 3:
    return error_fixed(lay, h, 3, e, k, w);
  case 4:
    return error_fixed(lay, h, 4, e, k, w);
  case 5:
    return error_fixed(lay, h, 5, e, k, w);
  default:
    return error_fixed(lay, h, 7, e, k, w);
  }
}

extern const bd_linear_kernels PASTE(bd_linear_, BD_LEVEL);

const bd_kernels PASTE(bd_kernels_, BD_LEVEL) = {
#define STRING2(a) #a
#define STRING(a) STRING2(a)
    .level = STRING(BD_LEVEL),
    .linear = &PASTE(bd_linear_, BD_LEVEL),
    .joints = {{joints_00, joints_01}, {joints_10, joints_11}},
    .contact = {{contact_00, contact_01}, {contact_10, contact_11}},
    .combine = combine,
    .error_norm = error_norm,
};
