/* SPDX-License-Identifier: MIT
 *
 * What damps the normal force of contact: b + d (c1 p^2 + c2 p), the second part that of Hunt and
 * Crossley (MODEL section 3). Kernels without it are functions of their own.
 */
#ifndef BELTDYN_NORMAL_FORCE_H
#define BELTDYN_NORMAL_FORCE_H

#include "kernels/kernels.h"
#include "kernels/vector.h"

typedef struct contact_damping {
  vec linear, by_force;
} contact_damping;

INLINE contact_damping contact_damping_of(const bd_contact_pulley *pulley) {
  return (contact_damping){splat(pulley->damping), splat(pulley->hunt_crossley)};
}

/* N s/m, under the elastic force. */
INLINE vec damping_at(const contact_damping *c, vec elastic, const int hunt_crossley) {
  return hunt_crossley ? fma_(c->by_force, elastic, c->linear) : c->linear;
}

/* Derivative of the normal force to p, from that of the elastic force. */
INLINE vec stiffness_at(const contact_damping *c, vec of_elastic, vec rate,
                        const int hunt_crossley) {
  return hunt_crossley ? of_elastic * fma_(c->by_force, rate, splat(1.0)) : of_elastic;
}

#endif
