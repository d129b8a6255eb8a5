/* SPDX-License-Identifier: MIT
 *
 * ALE belt (MODEL section 11.4): friction at both ends of what lies on the pulley of an arc's
 * cells, and the transport of its states with the belt.
 */

/* What an arc's cells have in common at slot k: what of a cell lies on the pulley, and its half in
 * metres of belt, and over these; what presses, in all, and the shear of the end of the wrap. */
typedef struct lying {
  vec part, per_part, half_m, per_half_m, pressed, shear, lies;
} lying;

/* One place of friction of cells, at either end of what lies there: how far it is through the cell,
 * on which radius, by W over what lies; slip velocity and normal force per metre for the law, whose
 * force is per metre of belt, of which a place has half of what lies. */
typedef struct sliding {
  law_at at;
  vec from, deep, rho, slip;
  mask moves; /* its state */
} sliding;

INLINE lying lying_at(const bd_ale *ale, const bd_ale_arc *arc, const bd_ale_state *y, int k) {
  const vec half = splat(0.5), part = load(ale->cut_b + k) - load(ale->cut_a + k);
  const vec per_part = splat(1.0) / part;
  return (lying){
      .part = part,
      .per_part = per_part,
      .per_half_m = splat(2.0) * load(ale->per_m + k) * per_part,
      .half_m = half * load(y->m + k) * part,
      .pressed = half * splat(arc->cell_angle) * larger(load(ale->pressing + k), splat(0.0)),
      .shear = half * splat(arc->cell_angle) * load(ale->shear + k),
      .lies = load(ale->lies + k),
  };
}

INLINE sliding sliding_at(const bd_ale *ale, const bd_ale_arc *arc, const lying *on, int k,
                          const int end) {
  const vec none = splat(0.0), more = load((end == 0 ? ale->end_a : ale->end_b) + k);
  const vec here = load(ale->slid + k), there = load_unaligned(ale->slid + k + 1);
  const vec from = load((end == 0 ? ale->cut_a : ale->cut_b) + k);
  const vec deep = load((end == 0 ? ale->deep_a : ale->deep_b) + k);
  const vec rho = splat(arc->radius + arc->raised) - load(ale->sink + k) * deep;
  const vec normal = larger(fma_(on->shear, more, on->pressed * on->part), none);
  const vec slip = fma_(from, there - here, here) - splat(arc->sense * arc->axis.omega) * rho;
  return (sliding){
      .at = {.v = where(less(none, on->lies), slip),
             .normal = on->lies * normal * on->per_half_m,
             .touch = less(none, on->lies)},
      .from = from,
      .deep = deep,
      .rho = rho,
      .slip = slip,
      .moves = less(none, on->lies),
  };
}

/* Force of all elements; their rates are set. */
INLINE vec friction_of_end(const law_constants *c, sliding *end, const lying *on, int states,
                           int stride, const double *z, double *dz, const int law,
                           const int has_states) {
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
  return on->lies * force * on->half_m;
}

/* Discontinuous Galerkin of first order: what runs through what lies of a cell moves its states by
 * what runs in, which is that of the cell before it, or 0 where the belt comes on. */
INLINE void carry_states(const bd_ale *ale, const lying *on, const bd_ale_state *y,
                         const bd_ale_state *dy, int k, int states) {
  const vec none = splat(0.0), half = splat(0.5);
  const vec flow = half * (load(ale->flow + k) + load_unaligned(ale->flow + k + 1));
  const vec speed = half * on->lies * flow * on->per_half_m;
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

INLINE void add_friction(bd_ale *ale, int j, const bd_ale_state *y, const bd_ale_state *dy,
                         const int law, const int has_states) {
  bd_ale_arc *arc = &ale->arcs[j];
  const law_constants c = law_prepare(&arc->friction, 1.0, law);
  vec torque = splat(0.0), lost = torque;
  for (int k = arc->begin; k < arc->begin + arc->n; k += WIDTH) {
    const lying on = lying_at(ale, arc, y, k);
    sliding a = sliding_at(ale, arc, &on, k, 0), b = sliding_at(ale, arc, &on, k, 1);
    const vec force_a = friction_of_end(&c, &a, &on, arc->states, y->stride, y->z[0] + k,
                                        dy->z[0] + k, law, has_states);
    const vec force_b = friction_of_end(&c, &b, &on, arc->states, y->stride, y->z[1] + k,
                                        dy->z[1] + k, law, has_states);
    const vec after = fma_(a.from, force_a, b.from * force_b);
    store(ale->force_a + k, force_a + force_b - after);
    store(ale->force_b + k, after);
    torque = fma_(a.rho, force_a, fma_(b.rho, force_b, torque));
    lost = fma_(force_a, a.slip, fma_(force_b, b.slip, lost));
    if (has_states) {
      carry_states(ale, &on, y, dy, k, arc->states);
    }
  }
  arc->torque = arc->sense * sum(torque);
  arc->slip_loss = sum(lost);
}

/* Without friction. */
static void add_friction_NONE(bd_ale *ale, int j, const bd_ale_state *y, const bd_ale_state *dy) {
  bd_ale_arc *arc = &ale->arcs[j];
  (void)y, (void)dy;
  memset(ale->force_a + arc->begin, 0, (size_t)arc->slots * sizeof(double));
  memset(ale->force_b + arc->begin, 0, (size_t)arc->slots * sizeof(double));
  arc->torque = arc->slip_loss = 0.0;
}

#define ADD_FRICTION(name, class, general, states, text)                                           \
  static void add_friction_##name(bd_ale *ale, int j, const bd_ale_state *y,                       \
                                  const bd_ale_state *dy) {                                        \
    add_friction(ale, j, y, dy, BD_LAW_##name, (states) != 0);                                     \
  }
BD_LAWS(ADD_FRICTION)
#undef ADD_FRICTION
