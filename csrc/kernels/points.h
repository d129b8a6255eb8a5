/* SPDX-License-Identifier: MIT
 *
 * Contact of joints: their positions and velocities from the links that meet there, and forces at
 * joints as forces and moments of the links. Compiled once per instruction level, in rhs.h.
 */

/* Into the links' scratch, the last one's also before the first. */
static void directions(const bd_links *links, const double *y) {
  const double *phi = bd_cfield(&links->lay, y, F_PHI);
  for (int i = 0; i < links->lay.n8; i += WIDTH) {
    vec c, s;
    sine_cosine(load(phi + i), &s, &c);
    store(links->cos + i, c);
    store(links->sin + i, s);
  }
  links->cos[-1] = links->cos[links->lay.n - 1];
  links->sin[-1] = links->sin[links->lay.n - 1];
}

static void gather_points(const bd_links *links, const double *co, const double *si,
                          const double *y, const bd_points *points) {
  const bd_layout *lay = &links->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *w = bd_cfield(lay, y, F_VPHI);
  const vec half = splat(0.5), quarter = splat(0.5 * links->half);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec c = load(co + i), s = load(si + i), cl = load_unaligned(co + i - 1);
    const vec sl = load_unaligned(si + i - 1), turn = load(w + i),
              turn_l = load_unaligned(w + i - 1);
    store(points->x + i, fma_(quarter, cl - c, half * (load_unaligned(x + i - 1) + load(x + i))));
    store(points->y + i, fma_(quarter, sl - s, half * (load_unaligned(yy + i - 1) + load(yy + i))));
    store(points->vx + i, fma_(quarter, fnma_(turn_l, sl, turn * s),
                               half * (load_unaligned(vx + i - 1) + load(vx + i))));
    store(points->vy + i, fma_(quarter, fnma_(turn, c, turn_l * cl),
                               half * (load_unaligned(vy + i - 1) + load(vy + i))));
  }
}

static void scatter_forces(const bd_links *links, const double *co, const double *si,
                           const double *fx, const double *fy, double *dy) {
  const bd_layout *lay = &links->lay;
  double *ax = bd_field(lay, dy, F_VX), *ay = bd_field(lay, dy, F_VY);
  double *aphi = bd_field(lay, dy, F_VPHI);
  const vec half = splat(0.5 * links->inv_mass),
            arm = splat(0.5 * links->half * links->inv_inertia);
  const vec none = splat(0.0);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const mask link = less(none, load(links->link_mask + i));
    const vec lx = load(fx + i), ly = load(fy + i);
    const vec rx = load_unaligned(fx + i + 1), ry = load_unaligned(fy + i + 1);
    const vec turning = fnma_(load(si + i), rx - lx, load(co + i) * (ry - ly));
    store(ax + i, load(ax + i) + where(link, half * (lx + rx)));
    store(ay + i, load(ay + i) + where(link, half * (ly + ry)));
    store(aphi + i, load(aphi + i) + where(link, arm * turning));
  }
}
