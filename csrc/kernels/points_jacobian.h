/* SPDX-License-Identifier: MIT
 *
 * Contact of joints in the linear systems, compiled once per instruction level, in jacobian.h.
 *
 * The point of joint i, between links l = i - 1 and i, moves by dr = A_l k_l + A_i k_i with the
 * links' unknowns k = (x, y, p), p the motion of a link's end: A_l = [1 | e'_l] / 2, A_i = [1 |
 * -e'_i] / 2. Its velocity changes by dv = A k_v + W k_q: what turns with w_l and w_i turns its
 * end, W_l = [0 | -w_l e_l] / 2, W_i = [0 | w_i e_i] / 2. A force G there is the force A^T G on the
 * links, and moves with e'. With k_q = b_q + g k_v, blocks of the ring are A_a^T (B A_b + g V W_b),
 * B and V what add_contact gives at the point; and G turns with the links' ends.
 */

/* Halo of a block of links: the last one before the first, the first one after the last. */
INLINE void close_ring(double *v, int n) {
  v[-1] = v[n - 1];
  v[n] = v[0];
}

/* Positions and velocities of the joints' points at y, whose halo is set here. */
static void gather_of_joints(const bd_links *links, const bd_tangent *tangent, double *y,
                             const bd_points *points) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n;
  const double quarter = 0.5 * links->half;
  for (int f = F_X; f <= F_VPHI; ++f) {
    double *v = bd_field(lay, y, f);
    v[-1] = v[n - 1];
  }
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *co = tangent->cos, *si = tangent->sin, *w = tangent->spin;
  const vec half = splat(0.5), q = splat(quarter);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec c = load(co + i), s = load(si + i), cl = load_unaligned(co + i - 1);
    const vec sl = load_unaligned(si + i - 1), turn = load(w + i),
              turn_l = load_unaligned(w + i - 1);
    store(points->x + i, fma_(q, cl - c, half * (load_unaligned(x + i - 1) + load(x + i))));
    store(points->y + i, fma_(q, sl - s, half * (load_unaligned(yy + i - 1) + load(yy + i))));
    store(points->vx + i,
          fma_(q, fnma_(turn_l, sl, turn * s), half * (load_unaligned(vx + i - 1) + load(vx + i))));
    store(points->vy + i,
          fma_(q, fnma_(turn, c, turn_l * cl), half * (load_unaligned(vy + i - 1) + load(vy + i))));
  }
}

/* How the points move by c: x, y by positions and angles; vx, vy what the links' turning adds to
 * their velocities by angles, W c; and where c is solved, the velocities as well. */
static void project(const bd_links *links, const bd_tangent *tangent, double *c, int solved,
                    const bd_points *points) {
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const int n = lay->n;
  const vec half = splat(0.5), q = splat(0.5 * links->half);
  for (int f = F_X; f <= F_VPHI; ++f) {
    double *v = bd_field(lay, c, f);
    v[-1] = v[n - 1];
  }
  const double *x = bd_cfield(lay, c, F_X), *y = bd_cfield(lay, c, F_Y);
  const double *phi = bd_cfield(lay, c, F_PHI), *vphi = bd_cfield(lay, c, F_VPHI);
  const double *vx = bd_cfield(lay, c, F_VX), *vy = bd_cfield(lay, c, F_VY);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec co = load(t.cos + i), si = load(t.sin + i), w = load(t.spin + i);
    const vec col = load_unaligned(t.cos + i - 1), sil = load_unaligned(t.sin + i - 1);
    const vec wl = load_unaligned(t.spin + i - 1);
    const vec a = q * load(phi + i), al = q * load_unaligned(phi + i - 1);
    store(points->x + i,
          fma_(half, load_unaligned(x + i - 1) + load(x + i), fnma_(al, sil, a * si)));
    store(points->y + i,
          fma_(half, load_unaligned(y + i - 1) + load(y + i), fnma_(a, co, al * col)));
    vec px = fnma_(al * wl, col, a * w * co), py = fnma_(al * wl, sil, a * w * si);
    if (solved) {
      const vec b = q * load(vphi + i), bl = q * load_unaligned(vphi + i - 1);
      px += fma_(half, load_unaligned(vx + i - 1) + load(vx + i), fnma_(bl, sil, b * si));
      py += fma_(half, load_unaligned(vy + i - 1) + load(vy + i), fnma_(b, co, bl * col));
    }
    store(points->vx + i, px);
    store(points->vy + i, py);
  }
}

/* The blocks of the ring from those at the joints. */
static void assemble(const bd_links *links, const bd_tangent *tangent, double g,
                     const bd_joint_blocks *joints, const bd_blocks *blocks) {
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const bd_joint_blocks j = *joints;
  const bd_blocks b = *blocks;
  const int n = lay->n;
  double *const closed[] = {j.xx, j.xy, j.yx, j.yy, j.vxx, j.vxy, j.vyx, j.vyy, j.fx, j.fy};
  for (size_t k = 0; k < sizeof closed / sizeof closed[0]; ++k) {
    close_ring(closed[k], n);
  }
  const vec half = splat(0.5), quarter = splat(0.25), step = splat(0.5 * g);
  const vec geometric = splat(g * g / links->half);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec c = load(t.cos + i), s = load(t.sin + i), w = step * load(t.spin + i);
    const vec cl = load_unaligned(t.cos + i - 1), sl = load_unaligned(t.sin + i - 1);
    const vec wl = step * load_unaligned(t.spin + i - 1);
    const vec xx = load(j.xx + i), xy = load(j.xy + i), yx = load(j.yx + i), yy = load(j.yy + i);
    const vec vxx = load(j.vxx + i), vxy = load(j.vxy + i);
    const vec vyx = load(j.vyx + i), vyy = load(j.vyy + i);
    /* columns of the angles: of link i, -B e' / 2 + g V w e / 2; of the one before the opposite */
    const vec ux = fma_(half, fnma_(xy, c, xx * s), w * fma_(vxy, s, vxx * c));
    const vec uy = fma_(half, fnma_(yy, c, yx * s), w * fma_(vyy, s, vyx * c));
    const vec ulx = -fma_(half, fnma_(xy, cl, xx * sl), wl * fma_(vxy, sl, vxx * cl));
    const vec uly = -fma_(half, fnma_(yy, cl, yx * sl), wl * fma_(vyy, sl, vyx * cl));
    /* link i by itself, from the joint on its left ... */
    const vec pull = fma_(s, load(j.fy + i), c * load(j.fx + i));
    vec dxx = quarter * xx, dxy = quarter * xy, dyx = quarter * yx, dyy = quarter * yy;
    vec dxp = half * ux, dyp = half * uy;
    vec dpx = quarter * fnma_(c, yx, s * xx), dpy = quarter * fnma_(c, yy, s * xy);
    vec dpp = half * fnma_(c, uy, s * ux);
    /* ... and from that on its right */
    const vec rxx = load_unaligned(j.xx + i + 1), rxy = load_unaligned(j.xy + i + 1);
    const vec ryx = load_unaligned(j.yx + i + 1), ryy = load_unaligned(j.yy + i + 1);
    const vec rvxx = load_unaligned(j.vxx + i + 1), rvxy = load_unaligned(j.vxy + i + 1);
    const vec rvyx = load_unaligned(j.vyx + i + 1), rvyy = load_unaligned(j.vyy + i + 1);
    const vec rux = -fma_(half, fnma_(rxy, c, rxx * s), w * fma_(rvxy, s, rvxx * c));
    const vec ruy = -fma_(half, fnma_(ryy, c, ryx * s), w * fma_(rvyy, s, rvyx * c));
    const vec push = fma_(s, load_unaligned(j.fy + i + 1), c * load_unaligned(j.fx + i + 1));
    dxx = fma_(quarter, rxx, dxx);
    dxy = fma_(quarter, rxy, dxy);
    dyx = fma_(quarter, ryx, dyx);
    dyy = fma_(quarter, ryy, dyy);
    dxp = fma_(half, rux, dxp);
    dyp = fma_(half, ruy, dyp);
    dpx = fma_(quarter, fnma_(s, rxx, c * ryx), dpx);
    dpy = fma_(quarter, fnma_(s, rxy, c * ryy), dpy);
    const vec turning = half * (push - pull); /* of the forces' moments by the angle */
    dpp = fma_(half, fnma_(s, rux, c * ruy), fma_(geometric, turning, dpp));
    store(j.turning + i, turning);
    store(b.xx + i, load(b.xx + i) + dxx);
    store(b.xy + i, load(b.xy + i) + dxy);
    store(b.yx + i, load(b.yx + i) + dyx);
    store(b.yy + i, load(b.yy + i) + dyy);
    store(b.pp + i, load(b.pp + i) + dpp);
    store(b.xp + i, dxp);
    store(b.yp + i, dyp);
    store(b.px + i, dpx);
    store(b.py + i, dpy);
    /* link i by the one before it, and that one by link i */
    const vec back[9] = {quarter * xx,
                         quarter * xy,
                         half * ulx,
                         quarter * yx,
                         quarter * yy,
                         half * uly,
                         quarter * fnma_(c, yx, s * xx),
                         quarter * fnma_(c, yy, s * xy),
                         half * fnma_(c, uly, s * ulx)};
    const vec forward[9] = {quarter * xx,
                            quarter * xy,
                            half * ux,
                            quarter * yx,
                            quarter * yy,
                            half * uy,
                            quarter * fnma_(sl, xx, cl * yx),
                            quarter * fnma_(sl, xy, cl * yy),
                            half * fnma_(sl, ux, cl * uy)};
    for (int k = 0; k < 9; ++k) {
      store(b.back[k] + i, back[k]);
      store(b.forward[k] + i, forward[k]);
    }
  }
}

/* Forces at joints, whose halo is set here, added to those of the links. */
static void to_links(const bd_links *links, const bd_tangent *tangent, double *fx, double *fy,
                     double *x, double *y, double *p) {
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const vec half = splat(0.5);
  close_ring(fx, lay->n);
  close_ring(fy, lay->n);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec lx = load(fx + i), ly = load(fy + i);
    const vec rx = load_unaligned(fx + i + 1), ry = load_unaligned(fy + i + 1);
    store(x + i, fma_(half, lx + rx, load(x + i)));
    store(y + i, fma_(half, ly + ry, load(y + i)));
    const vec turning = fnma_(load(t.sin + i), rx - lx, load(t.cos + i) * (ry - ly));
    store(p + i, fma_(half, turning, load(p + i)));
  }
}

/* What the links' angles do to the moments of the forces at their ends, added. */
static void add_turning(const bd_layout *lay, const bd_joint_blocks *joints, double g,
                        const double *c, double *p) {
  const double *phi = bd_cfield(lay, c, F_PHI);
  const vec g2 = splat(g * g);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    store(p + i, fnma_(g2 * load(joints->turning + i), load(phi + i), load(p + i)));
  }
}

/* A pulley's row of the border, from that at the joints. */
static void row_of_links(const bd_links *links, const bd_tangent *tangent, double g, double *row_x,
                         double *row_y, double *row_vx, double *row_vy, double *x, double *y,
                         double *p) {
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const vec half = splat(0.5), step = splat(0.5 * g);
  double *const closed[] = {row_x, row_y, row_vx, row_vy};
  for (int k = 0; k < 4; ++k) {
    close_ring(closed[k], lay->n);
  }
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec lx = load(row_x + i), ly = load(row_y + i);
    const vec rx = load_unaligned(row_x + i + 1), ry = load_unaligned(row_y + i + 1);
    const vec dvx = load(row_vx + i) - load_unaligned(row_vx + i + 1);
    const vec dvy = load(row_vy + i) - load_unaligned(row_vy + i + 1);
    const vec c = load(t.cos + i), s = load(t.sin + i), w = step * load(t.spin + i);
    const mask link = less(splat(0.0), load(links->link_mask + i));
    store(x + i, where(link, half * (lx + rx)));
    store(y + i, where(link, half * (ly + ry)));
    const vec turning = half * fnma_(s, rx - lx, c * (ry - ly));
    store(p + i, where(link, fma_(w, fma_(s, dvy, c * dvx), turning)));
  }
}

static double ring_product(const bd_layout *lay, const double *const row[3], const double *x,
                           const double *y, const double *p) {
  vec total = splat(0.0);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    total = fma_(load(row[0] + i), load(x + i), total);
    total = fma_(load(row[1] + i), load(y + i), total);
    total = fma_(load(row[2] + i), load(p + i), total);
  }
  return sum(total);
}
