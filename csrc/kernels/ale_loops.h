/* SPDX-License-Identifier: MIT
 *
 * ALE belt, compiled once per instruction level: all of its rate.
 */
#include "kernels/kernels.h"
#include "kernels/vector.h"

#include "kernels/laws.h"

#include "kernels/ale_modes.h"

#include "kernels/ale_tension.h"

#include "kernels/ale_friction.h"

#include "kernels/ale_momentum.h"

#include "kernels/ale_slopes.h"

#include "kernels/ale_answers.h"

#include "kernels/ale_blocks.h"

#include "kernels/ale_solutions.h"

#define ALE_FRICTION(name, class, general, states, text) [BD_LAW_##name] = add_friction_##name,
#define ALE_SLOPES(name, class, general, states, text) [BD_LAW_##name] = slopes_##name,
const bd_ale_kernels PASTE(bd_ale_, BD_LEVEL) = {
    .place = place,
    .stretch = stretch,
    .path = path,
    .freeze = freeze,
    .add_friction = {add_friction_NONE, BD_LAWS(ALE_FRICTION)},
    .move = move,
    .slopes = {slopes_NONE, BD_LAWS(ALE_SLOPES)},
    .answer = answer,
    .factor = factor,
    .solve = solve,
    .solve_all = solve_all,
    .deduct = deduct,
};
