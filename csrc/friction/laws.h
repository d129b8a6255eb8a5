/* SPDX-License-Identifier: MIT
 *
 * The friction laws (MODEL section 4): one header each, and one row in the table below. From these
 * come kernels at every instruction level, checks of the parameters, what step control and settling
 * ask of a law, and its class in Python and kind in TOML.
 *
 * A law's header gives its parameters and, where BD_LAW_FUNCTIONS is defined (the kernels, which
 * know vectors), these functions of it:
 *
 *   NAME_constants, NAME_prepare     what it needs of its parameters and a link's length l0
 *   NAME_value(c, at)                force and rate of its state
 *   NAME_slopes(c, at)               their derivatives, kinks taken as they stand
 *   NAME_bound(p)                    of its state's magnitude after a step; INFINITY: none
 *   NAME_kinetic(p, element)         coefficient of friction in full slip, of an element
 *
 * Where a link does not touch, value and slopes must give a rate of 0 (`at.touch`; slip velocity
 * and normal force are 0 there). tests/test_law_slopes.py holds every law of the table to the
 * differences of its value.
 */
#ifndef BELTDYN_LAWS_H
#define BELTDYN_LAWS_H

/* X(name, class in Python, general, states, text). general: 0 where the force is the state times N,
 * and nothing else depends on N, for which the linear systems have shorter loops. states: how many
 * a link on a pulley has, 0 or 1, or BD_SEVERAL: one for each number in its lists. */
enum { BD_SEVERAL = -1 };
#define BD_LAWS(X)                                                                                 \
  X(dahl, Dahl, 0, 1, "Dahl")                                                                      \
  X(lugre, LuGre, 1, 1, "LuGre")                                                                   \
  X(elastic_plastic, ElasticPlastic, 1, 1, "elastic/perfectly plastic")                            \
  X(coulomb, Coulomb, 1, 0, "regularised Coulomb")                                                 \
  X(creep_rate, CreepRate, 1, 0, "creep-rate-dependent")                                           \
  X(threlfall, Threlfall, 1, 0, "Threlfall")                                                       \
  X(maxwell_slip, MaxwellSlip, 1, BD_SEVERAL, "Maxwell slip")

#endif

#include "friction/stribeck.h"

#include "friction/coulomb.h"
#include "friction/creep_rate.h"
#include "friction/dahl.h"
#include "friction/elastic_plastic.h"
#include "friction/lugre.h"
#include "friction/maxwell_slip.h"
#include "friction/threlfall.h"
