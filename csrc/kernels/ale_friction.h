/* SPDX-License-Identifier: MIT
 *
 * ALE belt (MODEL section 11.4): friction at both ends of the cells on an arc, and the transport of
 * its states with the belt (section 4).
 */

/* One end of cells at place k: slip velocity and normal force per metre for the law; its force is
 * per metre of belt, of which an end has m / 2. */
typedef struct rubbing {
  law_at at;
  vec slip, half_m;
  mask moves; /* its state */
} rubbing;

INLINE rubbing rub_at(const bd_ale_arc *arc, vec slid, vec rim, vec share, vec half_m, vec pressed,
                      vec is_cell) {
  const vec none = splat(0.0), slip = slid - rim;
  const vec normal = is_cell * pressed * share / half_m;
  const mask moves = less(none, arc->held ? share : is_cell);
  return (rubbing){
      .at = {.v = is_cell * where(moves, slip), .normal = normal, .touch = less(none, is_cell)},
      .slip = slip,
      .half_m = half_m,
      .moves = moves};
}

/* Force of all elements; their rates are set. */
INLINE vec rub_end(const law_constants *c, rubbing *end, int states, int stride, const double *z,
                   double *dz, const int law, const int has_states) {
  vec force = splat(0.0);
  for (int e = 0; e < (has_states ? states : 1); ++e) {
    end->at.element = e;
    end->at.z = has_states ? load(z + e * stride) : splat(0.0);
    const law_value value = law_value_of(c, &end->at, law);
    force = force + value.force;
    if (has_states) {
      store(dz + e * stride, value.rate);
    }
  }
  return force * end->half_m;
}

/* Discontinuous Galerkin of first order: what runs through a cell moves its states by what runs in,
 * which is that of the cell before it, or 0 where the belt comes on. */
INLINE void carry_states(const bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy, int k,
                         int states) {
  const vec none = splat(0.0), half = splat(0.5), is_cell = load(ale->is_cell + k);
  const vec flow = half * (load(ale->flow + k) + load_unaligned(ale->flow + k + 1));
  const vec speed = is_cell * flow / load(y->m + k);
  const mask back = less(flow, none);
  for (int e = 0; e < states; ++e) {
    const int at = e * y->stride + k;
    const vec a = load(y->z[0] + at), b = load(y->z[1] + at);
    const vec arrives = load_unaligned(y->z[1] + at - 1),
              returns = load_unaligned(y->z[0] + at + 1);
    const vec mean = half * (a + b), apart = half * (a - b);
    const vec r_1 = speed * choose(back, apart, arrives - mean);
    const vec r_2 = speed * choose(back, mean - returns, apart);
    store(dy->z[0] + at, fma_(splat(4.0), r_1, fnma_(splat(2.0), r_2, load(dy->z[0] + at))));
    store(dy->z[1] + at, fma_(splat(4.0), r_2, fnma_(splat(2.0), r_1, load(dy->z[1] + at))));
  }
}

INLINE void rub(bd_ale *ale, int j, const bd_ale_state *y, const bd_ale_state *dy, const int law,
                const int has_states) {
  bd_ale_arc *arc = &ale->arcs[j];
  const law_constants c = law_prepare(&arc->friction, 1.0, law);
  const vec none = splat(0.0), half = splat(0.5), r0 = splat(arc->radius + arc->raised);
  const vec speed = splat(arc->sense * arc->axis.omega);
  const vec half_angle = splat(0.5 * arc->cell_angle);
  vec torque = none, lost = none;
  for (int k = arc->begin; k < arc->begin + arc->n; k += WIDTH) {
    const vec is_cell = load(ale->is_cell + k), half_m = half * load(y->m + k);
    const vec rho = r0 - load(ale->sink + k), rim = speed * rho;
    const vec pressed = half_angle * larger(load(ale->pressing + k), none);
    rubbing a =
        rub_at(arc, load(ale->slid + k), rim, load(ale->share_a + k), half_m, pressed, is_cell);
    rubbing b = rub_at(arc, load_unaligned(ale->slid + k + 1), rim, load(ale->share_b + k), half_m,
                       pressed, is_cell);
    const vec force_a = is_cell * rub_end(&c, &a, arc->states, y->stride, y->z[0] + k, dy->z[0] + k,
                                          law, has_states);
    const vec force_b = is_cell * rub_end(&c, &b, arc->states, y->stride, y->z[1] + k, dy->z[1] + k,
                                          law, has_states);
    store(ale->force_a + k, force_a);
    store(ale->force_b + k, force_b);
    torque = fma_(rho, force_a + force_b, torque);
    lost = fma_(force_a, a.slip, fma_(force_b, b.slip, lost));
    if (has_states) {
      carry_states(ale, y, dy, k, arc->states);
    }
  }
  arc->torque = arc->sense * sum(torque);
  arc->slip_loss = sum(lost);
}

/* Without friction. */
static void rub_NONE(bd_ale *ale, int j, const bd_ale_state *y, const bd_ale_state *dy) {
  bd_ale_arc *arc = &ale->arcs[j];
  (void)y, (void)dy;
  memset(ale->force_a + arc->begin, 0, (size_t)arc->slots * sizeof(double));
  memset(ale->force_b + arc->begin, 0, (size_t)arc->slots * sizeof(double));
  arc->torque = arc->slip_loss = 0.0;
}

#define RUB(name, class, general, states, text)                                                    \
  static void rub_##name(bd_ale *ale, int j, const bd_ale_state *y, const bd_ale_state *dy) {      \
    rub(ale, j, y, dy, BD_LAW_##name, (states) != 0);                                              \
  }
BD_LAWS(RUB)
#undef RUB
