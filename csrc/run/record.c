/* SPDX-License-Identifier: MIT
 *
 * The restart record: everything that a run needs to go on bit for bit, where a state alone has
 * positions, velocities and friction but not the step and its controller, the states a multistep
 * method looks back on, the rate and directions last evaluated, which links are listed near the
 * pulleys, what "auto" has chosen, and what guards, torque functions and twins remember.
 *
 * A record is a head and a copy of the pieces that those who carved them said are kept (BD_KEEP and
 * what stands with it, base/base.h), one after the other. The head names format and build and holds
 * check sums of what was given when the simulation was made and of what follows; a record of
 * another scene or build, and one that was damaged, is refused, and whatever is used as an index is
 * checked before anything is read. Guarded by tests/test_record.py.
 */
#include <string.h>

#include "run/run.h"

enum { FORMAT = 6 };

typedef struct head {
  char magic[8];
  uint32_t format, build;  /* build: of compiler and instruction level */
  uint64_t size;           /* of what follows */
  uint64_t scene, content; /* check sums */
} head;

static const char MAGIC[8] = {'b', 'e', 'l', 't', 'd', 'y', 'n', 'R'};

/* --- pieces ---------------------------------------------------------------------------------- */

typedef struct visitor {
  enum { MEASURE, WRITE, CHECK, READ } does;
  char *out;
  const char *in;
  size_t used;
  int bad; /* CHECK: an index is out of its range */
} visitor;

static void visit_piece(visitor *v, const bd_kept *piece) {
  void *at = piece->place;
  if (piece->is == BD_KEPT_BEHIND) {
    memcpy(&at, piece->place, sizeof at);
  }
  if (v->does == WRITE) {
    memcpy(v->out + v->used, at, piece->size);
  } else if (v->does == READ) {
    memcpy(at, v->in + v->used, piece->size);
  }
  for (size_t k = 0; v->does == CHECK && piece->is == BD_KEPT_INDEXES && k < piece->size;
       k += sizeof(int)) {
    int index;
    memcpy(&index, v->in + v->used + k, sizeof index);
    v->bad |= index < piece->least || index > piece->most;
  }
  v->used += piece->size;
}

/* Those beside the run that are as it is have its method (growth.c). */
static void visit(visitor *v, bd_sim *sim) {
  bd_sim *const all[] = {sim, sim->twin.sim, sim->twin.still, sim->twin.missed.pair[0],
                         sim->twin.missed.pair[1]};
  for (int k = 0; k < 5; ++k) {
    for (size_t piece = 0; all[k] && piece < all[k]->n_kept; ++piece) {
      visit_piece(v, &all[k]->kept[piece]);
    }
    if (all[k] && v->does == READ) {
      bd_stepper *stepper = &all[k]->stepper;
      const bd_method *chosen = k < 3 ? sim->choice.method[sim->choice.now] : NULL;
      stepper->method = stepper->now = chosen ? chosen : stepper->method;
      bd_stepper_weigh_friction(stepper);
    }
  }
}

/* --- what it belongs to ---------------------------------------------------------------------- */

/* Of everything that was given when the simulation was made, but the state, the sample times and
 * max_steps, which may be another: of a torque or motion function, that there is one. */
static uint64_t scene_of(const bd_sim *sim) {
  const bd_options *options = &sim->options;
  const char *method = sim->choice.method[0] ? "auto" : sim->stepper.method->name;
  const uint64_t given[] = {sim->stepper.model->given, sim->given};
  const double numbers[] = {
      options->rtol,   options->step,   options->max_step, options->torque_interval,
      options->ledger, options->guards, sim->t_end};
  uint64_t sum = bd_check_sum(BD_NOTHING, given, sizeof given);
  sum = bd_check_sum(sum, numbers, sizeof numbers);
  return bd_check_sum(sum, method, strlen(method));
}

/* Bits are the same with the same compiler and instruction level alone. */
static uint32_t build_of(const bd_sim *sim) {
  const char *level = sim->stepper.plan.kernels->level;
  uint64_t sum = bd_check_sum(BD_NOTHING, level, strlen(level));
#ifdef __VERSION__
  sum = bd_check_sum(sum, __VERSION__, sizeof __VERSION__);
#endif
  return (uint32_t)(sum ^ sum >> 32);
}

/* --- out and in ------------------------------------------------------------------------------ */

size_t bd_sim_export(const bd_sim *sim, void *record) {
  /* nothing is written to the simulation when measuring or writing */
  bd_sim *const visited = (bd_sim *)(uintptr_t)sim;
  visitor v = {.does = MEASURE};
  if (sim->status < 0 && sim->status != BD_ERR_MAX_STEPS) {
    return 0;
  }
  visit(&v, visited);
  head first = {.format = FORMAT, .size = v.used};
  if (!record) {
    return sizeof first + v.used;
  }
  v = (visitor){.does = WRITE, .out = (char *)record + sizeof first};
  visit(&v, visited);
  memcpy(first.magic, MAGIC, sizeof first.magic);
  first.build = build_of(sim);
  first.scene = scene_of(sim);
  first.content = bd_check_sum(BD_NOTHING, v.out, v.used);
  memcpy(record, &first, sizeof first);
  return sizeof first + v.used;
}

int bd_sim_import(bd_sim *sim, const void *record, size_t size, bd_error *err) {
  if (sim->settling || sim->started) {
    return bd_fail(err, BD_ERR_BUSY, "record",
                   "a record is taken by a simulation that has not begun, and not by settling");
  }
  head first;
  visitor v = {.does = MEASURE};
  visit(&v, sim);
  memset(&first, 0, sizeof first);
  memcpy(&first, record, size < sizeof first ? size : sizeof first);
  if (memcmp(first.magic, MAGIC, sizeof first.magic) != 0 || first.format != FORMAT) {
    return bd_fail(err, BD_ERR_OPTION, "record",
                   "not a restart record of this version of the core (format %d)", (int)FORMAT);
  }
  if (first.build != build_of(sim)) {
    return bd_fail(
        err, BD_ERR_OPTION, "record",
        "the record was made with another instruction level than \"%s\" (BELTDYN_KERNELS "
        "chooses it) or another compiler, which do not give the same bits",
        sim->stepper.plan.kernels->level);
  }
  if (first.scene != scene_of(sim) || first.size != v.used) {
    return bd_fail(err, BD_ERR_OPTION, "record",
                   "the record is of another run: drive, torques, t_end and options must be those "
                   "it was made with");
  }
  const char *content = (const char *)record + sizeof first;
  if (size != sizeof first + v.used || first.content != bd_check_sum(BD_NOTHING, content, v.used)) {
    return bd_fail(err, BD_ERR_OPTION, "record", "the record is damaged: its check sum is wrong");
  }
  v = (visitor){.does = CHECK, .in = content};
  visit(&v, sim);
  if (v.bad) {
    return bd_fail(err, BD_ERR_OPTION, "record", "the record is damaged: an index is out of range");
  }
  v = (visitor){.does = READ, .in = content};
  visit(&v, sim);
  /* made anew: what follows from the time reached */
  sim->next_break = sim->next_sample = 0;
  while (sim->started && sim->next_sample < sim->n_samples &&
         sim->t_sample[sim->next_sample] <= sim->stepper.t) {
    ++sim->next_sample;
  }
  sim->status = sim->started ? BD_MORE : BD_OK;
  sim->stepper.jacobian_known = 0;
  bd_plan_place(&sim->stepper.plan, sim->stepper.t, sim->stepper.y);
  return BD_OK;
}
