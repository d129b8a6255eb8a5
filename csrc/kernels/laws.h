/* SPDX-License-Identifier: MIT
 *
 * The friction laws of friction/laws.h on vectors of links, by their number: a constant, for which
 * the compiler leaves one law of the switches.
 */
#ifndef BELTDYN_KERNELS_LAWS_H
#define BELTDYN_KERNELS_LAWS_H

/* Links that may be in contact: state, slip velocity and normal force, the latter two 0 where they
 * do not touch; which element of a law of several, and its state. */
typedef struct law_at {
  vec z, v, normal;
  mask touch;
  int element;
} law_at;

typedef struct law_value {
  vec force, rate; /* force against slip; rate of the state */
} law_value;

/* Their derivatives. */
typedef struct law_slopes {
  vec by_normal, by_state, by_slip;
  vec rate_by_normal, rate_by_state, rate_by_slip;
} law_slopes;

#define BD_LAW_FUNCTIONS
#include "friction/laws.h"
#undef BD_LAW_FUNCTIONS

typedef union law_constants {
  int none;
#define LAW(name, class, general, states, text) name##_constants name;
  BD_LAWS(LAW)
#undef LAW
} law_constants;

INLINE law_constants law_prepare(const bd_friction *friction, double l0, const int law) {
  law_constants c = {.none = 0};
  switch (law) {
#define LAW(name, class, general, states, text)                                                    \
  case BD_LAW_##name:                                                                              \
    c.name = name##_prepare(&friction->name, l0);                                                  \
    break;
    BD_LAWS(LAW)
#undef LAW
  }
  return c;
}

INLINE law_value law_value_of(const law_constants *c, const law_at *at, const int law) {
  switch (law) {
#define LAW(name, class, general, states, text)                                                    \
  case BD_LAW_##name:                                                                              \
    return name##_value(&c->name, at);
    BD_LAWS(LAW)
#undef LAW
  }
  return (law_value){.force = splat(0.0), .rate = splat(0.0)};
}

INLINE law_slopes law_slopes_of(const law_constants *c, const law_at *at, const int law) {
  switch (law) {
#define LAW(name, class, general, states, text)                                                    \
  case BD_LAW_##name:                                                                              \
    return name##_slopes(&c->name, at);
    BD_LAWS(LAW)
#undef LAW
  }
  return (law_slopes){.by_normal = splat(0.0)};
}

/* States that a link has under a law of the table; of most a constant. */
INLINE int law_states(const bd_contact_pulley *pulley, const int states) {
  return states == BD_SEVERAL ? pulley->states : states;
}

/* A law without a state has one element. */
INLINE int law_elements(const bd_contact_pulley *pulley, const int states) {
  return states == 0 ? 1 : law_states(pulley, states);
}

/* Force of all elements on links at place i, at what `common` has besides the state; their rates
 * are added to those in `rates`, less what belt that comes into contact takes of the mean. */
INLINE vec law_act(const law_constants *c, const law_at *common, const bd_contact_pulley *pulley,
                   const double *zs, double *rates, int i, const vec *fresh, const int law,
                   const int states) {
  vec force = splat(0.0);
  for (int e = 0; e < law_elements(pulley, states); ++e) {
    const int k = e * pulley->stride + i;
    law_at at = *common;
    at.element = e;
    at.z = states != 0 ? load(zs + k) : splat(0.0);
    const law_value value = law_value_of(c, &at, law);
    force = e == 0 ? value.force : force + value.force;
    if (states != 0) {
      store(rates + k, load(rates + k) + (fresh ? fnma_(*fresh, at.z, value.rate) : value.rate));
    }
  }
  return force;
}

#endif
