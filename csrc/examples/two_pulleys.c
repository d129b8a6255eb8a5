/* SPDX-License-Identifier: MIT
 *
 * A belt drive from C, without Python: settle it, run it for 50 ms, print speeds and tensions.
 *
 *   cc -std=c11 -O3 -fno-math-errno -fno-trapping-math -ffp-contract=off -Icsrc \
 *     -o two_pulleys csrc/examples/two_pulleys.c \
 *     $(find csrc -name '*.c' | grep -v -e binding -e examples -e avx) -lm
 *
 * which leaves out the Python binding and builds the baseline kernels alone.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "beltdyn.h"

enum { LINKS = 60, PULLEYS = 2, SAMPLES = 6 };

static int complain(const bd_error *error) {
  fprintf(stderr, "%s: %s\n", bd_error_symbol(error->code), error->message);
  return EXIT_FAILURE;
}

static int run(bd_sim *sim, bd_error *error) {
  int code;
  do {
    code = bd_sim_advance(sim, 1000, error); /* between chunks: look at the clock, the user, ... */
  } while (code == BD_MORE);
  return code;
}

int main(void) {
  const bd_pulley pulleys[PULLEYS] = {
      {.center = {0.0, 0.0}, .radius = 0.1, .inertia = 0.01},
      {.center = {0.29, 0.0}, .radius = 0.1, .inertia = 0.01},
  };
  const bd_friction friction = {.law = BD_LAW_dahl, .dahl = {.mu_k = 1.0, .sigma = 1e4}};
  const bd_scene scene = {
      .belt = {.length = 1.2,
               .n_bodies = LINKS,
               .linear_density = 0.1,
               .axial_stiffness = 70e3,
               .axial_damping = 1.4,
               .bending_stiffness = 0.01},
      .n_pulleys = PULLEYS,
      .pulleys = pulleys,
      .contact = {.quadratic = 5e10, .linear = 2.5e7, .damping = 1e3},
      .friction = &friction,
  };

  bd_error error;
  bd_model *model = NULL;
  if (bd_model_create(&model, &scene, &error) != BD_OK) {
    return complain(&error);
  }

  double links[8][LINKS], theta[PULLEYS], omega[PULLEYS];
  bd_state state = {.x = links[0],
                    .y = links[1],
                    .phi = links[2],
                    .vx = links[3],
                    .vy = links[4],
                    .vphi = links[5],
                    .mu = links[6],
                    .slip = links[7],
                    .theta = theta,
                    .omega = omega};
  bd_settling *settling = NULL;
  int code = bd_settle_create(&settling, model, NULL, NULL, &error);
  if (code == BD_OK) {
    do {
      code = bd_settle_advance(settling, 1000, &error);
    } while (code == BD_MORE);
  }
  if (code == BD_OK) {
    bd_sim_state(bd_settle_sim(settling), &state);
  }
  bd_settle_free(settling);
  if (code != BD_OK) {
    bd_model_free(model);
    return complain(&error);
  }

  bd_sim *sim = NULL;

  const double t[] = {0.0, 0.3}, torques[] = {0.0, 0.0, -100.0, 0.0};
  const double load[] = {0.0, 100.0 / 6.283185307179586};
  const bd_torque_term terms[] = {
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 2, .t = t, .values = torques},
      {.kind = BD_TORQUE_VISCOUS, .coefficients = load},
  };
  const bd_torque torque = {.n_terms = 2, .terms = terms};

  double times[SAMPLES], speed[SAMPLES][PULLEYS], force[SAMPLES][LINKS];
  double energy[SAMPLES][BD_ENERGY_residual + 1]; /* columns of a drive without bearing drag */
  for (int k = 0; k < SAMPLES; ++k) {
    times[k] = 0.01 * k;
  }
  const bd_output output = {.omega = speed[0], .force = force[0], .energy = energy[0]};
  code = bd_sim_create(&sim, model, &state, &torque, 0.05, NULL, &error);
  if (code == BD_OK) {
    code = bd_sim_set_output(sim, SAMPLES, times, &output, &error);
  }
  if (code == BD_OK) {
    code = run(sim, &error);
  }
  if (code == BD_OK) {
    puts("  t [s]   omega_0   omega_1 [rad/s]   least and largest joint force [N]");
    for (int k = 0; k < SAMPLES; ++k) {
      double least = force[k][0], largest = force[k][0];
      for (int i = 1; i < LINKS; ++i) {
        least = fmin(least, force[k][i]);
        largest = fmax(largest, force[k][i]);
      }
      printf("%7.3f %9.4f %9.4f %17.2f %9.2f\n", times[k], speed[k][0], speed[k][1], least,
             largest);
    }
    printf("energy residual %.2g J\n", energy[SAMPLES - 1][BD_ENERGY_residual]);
  } else {
    complain(&error);
  }
  bd_sim_free(sim);
  bd_model_free(model);
  return code == BD_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}
