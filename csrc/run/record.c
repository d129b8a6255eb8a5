/* SPDX-License-Identifier: MIT
 *
 * The restart record: everything that a run needs to go on bit for bit, where a state alone has
 * positions, velocities and friction but not the step and its controller, the states a multistep
 * method looks back on, the rate and directions last evaluated, which links are listed near the
 * pulleys, what "auto" has chosen, and what guards, torque functions and twins remember.
 *
 * One function visits every such field in order; it adds up sizes, writes or reads, so what is
 * written and what is read cannot differ. Pointers are never part of it: a method is its row in the
 * table. A head of the record names format and build and holds check sums of the scene and of what
 * follows; a record of another scene or build, and one that was damaged, is refused, and whatever
 * is used as an index is checked before anything is read. Guarded by
 * tests/test_record.py.
 */
#include <string.h>

#include "run/run.h"

enum { FORMAT = 2 };

typedef struct head {
  char magic[8];
  uint32_t format, build;  /* build: of compiler and instruction level */
  uint64_t size;           /* of what follows */
  uint64_t scene, content; /* check sums */
} head;

static const char MAGIC[8] = {'b', 'e', 'l', 't', 'd', 'y', 'n', 'R'};

/* FNV-1a (Fowler, Noll, Vo), 64 bits. */
static uint64_t hash(uint64_t sum, const void *data, size_t size) {
  const unsigned char *byte = data;
  for (size_t k = 0; k < size; ++k) {
    sum = (sum ^ byte[k]) * 0x100000001b3u;
  }
  return sum;
}

static const uint64_t EMPTY = 0xcbf29ce484222325u;

/* --- visiting -------------------------------------------------------------------------------- */

typedef struct visitor {
  enum { MEASURE, WRITE, CHECK, READ } does;
  char *out;
  const char *in;
  size_t used;
  int bad; /* CHECK: an index is out of its range */
} visitor;

/* data may be NULL where size is 0: nothing was carved. */
static void visit(visitor *v, void *data, size_t size) {
  if (size == 0) {
    return;
  }
  if (v->does == WRITE) {
    memcpy(v->out + v->used, data, size);
  } else if (v->does == READ) {
    memcpy(data, v->in + v->used, size);
  }
  v->used += size;
}

#define ONE(v, field) visit((v), &(field), sizeof(field))
#define MANY(v, array, count) visit((v), (array), (size_t)(count) * sizeof *(array))

/* A number that is used as an index or as a count. */
static void visit_index(visitor *v, int *value, int least, int most) {
  if (v->does == CHECK) {
    int given;
    memcpy(&given, v->in + v->used, sizeof given);
    v->bad |= given < least || given > most;
  }
  visit(v, value, sizeof *value);
}

/* A method that the stepper was made for, or the one that steps are left to. */
static void visit_method(visitor *v, const bd_method **method, const bd_stepper *stepper,
                         const bd_auto *choice) {
  const bd_method *const made[] = {choice->method[0], choice->method[1], stepper->method,
                                   bd_method_find("lie")};
  enum { N = sizeof made / sizeof made[0] };
  int index = 0;
  while (index < N - 1 && made[index] != *method) {
    ++index;
  }
  visit_index(v, &index, 0, N - 1);
  if (v->does == CHECK) {
    memcpy(&index, v->in + v->used - sizeof index, sizeof index);
    v->bad |= index >= 0 && index < N && !made[index];
  } else if (v->does == READ) {
    *method = made[index];
  }
}

static void visit_torque(visitor *v, bd_torque_functions *functions, int np) {
  ONE(v, functions->left_out);
  ONE(v, functions->next_left_out);
  ONE(v, functions->short_tries);
  ONE(v, functions->owed);
  ONE(v, functions->t_owed);
  ONE(v, functions->jump);
  ONE(v, functions->rough_for);
  ONE(v, functions->rough_until);
  ONE(v, functions->t_range);
  ONE(v, functions->ranges);
  MANY(v, functions->range, np);
  MANY(v, functions->least, np);
  MANY(v, functions->most, np);
  MANY(v, functions->last, np);
  MANY(v, functions->now, np);
}

static void visit_plan(visitor *v, bd_plan *plan, const bd_layout *lay) {
  bd_search *search = &plan->search;
  bd_motion_set *motion = &plan->torques.motion;
  if (motion->n > 0) {
    ONE(v, motion->begin);
    MANY(v, motion->offset, motion->n);
  }
  MANY(v, plan->owner, lay->n8 * lay->slots);
  MANY(v, plan->torque, lay->np);
  MANY(v, plan->friction, lay->np);
  MANY(v, plan->hub, 2 * lay->nm);
  MANY(v, plan->links.cos - BD_HALO, lay->stride);
  MANY(v, plan->links.sin - BD_HALO, lay->stride);
  ONE(v, plan->t_piece);
  ONE(v, plan->skip_power);
  ONE(v, plan->contacts_changed);
  ONE(v, search->margin);
  ONE(v, search->travelled);
  ONE(v, search->rebuilds);
  for (int j = 0; j < lay->np; ++j) {
    visit_index(v, &search->n_runs[j], 0, search->max_runs);
  }
  for (int k = 0; k < lay->np * search->max_runs; ++k) {
    visit_index(v, &search->runs[k].begin, 0, lay->n8);
    visit_index(v, &search->runs[k].end, 0, lay->n8);
  }
}

/* Between two steps: y_new, y_mid, the Jacobian and all stages but the first are made anew. */
static void visit_stepper(visitor *v, bd_stepper *stepper, const bd_auto *choice) {
  const bd_layout *lay = &stepper->model->lay;
  visit_method(v, &stepper->method, stepper, choice);
  visit_method(v, &stepper->now, stepper, choice);
  ONE(v, stepper->fixed);
  ONE(v, stepper->t);
  ONE(v, stepper->h);
  ONE(v, stepper->turns);
  MANY(v, stepper->y, lay->size);
  MANY(v, stepper->stage[0], lay->size);
  ONE(v, stepper->rate_known);
  int room = 0;
  while (room < MAX_HISTORY && stepper->history[room]) {
    ++room;
  }
  visit_index(v, &stepper->n_history, 0, room);
  ONE(v, stepper->history_h);
  for (int k = 0; k < MAX_HISTORY; ++k) {
    if (stepper->history[k]) {
      MANY(v, stepper->history[k], lay->size);
    }
  }
  ONE(v, stepper->nfev);
  ONE(v, stepper->njev);
  ONE(v, stepper->nlu);
  ONE(v, stepper->report);
  visit_plan(v, &stepper->plan, lay);
  visit_torque(v, &stepper->functions, lay->np);
}

static void visit_choice(visitor *v, bd_auto *choice) {
  ONE(v, choice->per_second);
  ONE(v, choice->time);
  ONE(v, choice->steps);
  visit_index(v, &choice->now, 0, N_AUTO - 1);
  ONE(v, choice->doubtful);
  ONE(v, choice->h_kept);
  ONE(v, choice->t_before);
  ONE(v, choice->t_judge);
  ONE(v, choice->tries_begin);
  ONE(v, choice->tries_judge);
  ONE(v, choice->look_after);
}

static void visit_guard(visitor *v, bd_guard *guard, int np) {
  ONE(v, guard->t_look);
  ONE(v, guard->t_window);
  ONE(v, guard->steps_look);
  ONE(v, guard->tries_window);
  ONE(v, guard->fed);
  ONE(v, guard->drive);
  ONE(v, guard->passed);
  MANY(v, guard->touched, np);
  ONE(v, guard->rings);
  ONE(v, guard->bounces);
}

static void visit_sim(visitor *v, bd_sim *sim, const bd_auto *choice);

/* Twins have the methods of the run they follow, or one of their own. */
static void visit_twin(visitor *v, bd_twin *twin, int np, const bd_auto *choice) {
  ONE(v, twin->active);
  ONE(v, twin->grows);
  ONE(v, twin->chatters);
  ONE(v, twin->times_chattered);
  ONE(v, twin->suspected);
  ONE(v, twin->last);
  ONE(v, twin->excused);
  ONE(v, twin->next_begin);
  ONE(v, twin->t_begin);
  ONE(v, twin->next_look);
  ONE(v, twin->apart);
  ONE(v, twin->grown);
  ONE(v, twin->most);
  ONE(v, twin->least);
  ONE(v, twin->before);
  ONE(v, twin->steps);
  ONE(v, twin->events);
  ONE(v, twin->t_events);
  ONE(v, twin->t_chatter);
  ONE(v, twin->random);
  ONE(v, twin->seen_t);
  MANY(v, twin->seen, 2 * np);
  MANY(v, twin->theta, np);
  ONE(v, twin->missed.active);
  ONE(v, twin->missed.steps);
  ONE(v, twin->missed.next_begin);
  ONE(v, twin->missed.apart);
  ONE(v, twin->missed.t_begin);
  ONE(v, twin->missed.grown);
  ONE(v, twin->missed.before);
  ONE(v, twin->missed.next_look);
  bd_sim *const all[] = {twin->sim, twin->still, twin->missed.pair[0], twin->missed.pair[1]};
  for (size_t k = 0; k < sizeof all / sizeof all[0]; ++k) {
    if (all[k]) {
      visit_sim(v, all[k], choice);
    }
  }
}

static void visit_sim(visitor *v, bd_sim *sim, const bd_auto *choice) {
  const int np = sim->stepper.model->lay.np;
  visit_stepper(v, &sim->stepper, choice);
  visit_choice(v, &sim->choice);
  visit_guard(v, &sim->guard, np);
  visit_twin(v, &sim->twin, np, choice);
  ONE(v, sim->t0);
  ONE(v, sim->e0);
  ONE(v, sim->error_before);
  ONE(v, sim->started);
  ONE(v, sim->fallbacks_in_a_row);
  ONE(v, sim->stats);
}

/* --- the scene ------------------------------------------------------------------------------- */

/* All parameters of a group. */
static uint64_t hash_group(uint64_t sum, const char *group, const void *values) {
  double numbers[BD_MAX_ELEMENTS];
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    if (strcmp(bd_parameters[k].group, group) == 0) {
      const int n = bd_parameter_values(&bd_parameters[k], values, numbers);
      sum = hash(sum, numbers, (size_t)n * sizeof *numbers);
    }
  }
  return sum;
}

/* Of everything that was given when the simulation was made, but the state, the sample times and
 * max_steps, which may be another: of a torque or motion function, that there is one. */
static uint64_t scene_of(const bd_sim *sim) {
  const bd_model *model = sim->stepper.model;
  const bd_torque_set *set = &sim->stepper.plan.torques;
  const bd_options *options = &sim->options;
  const size_t np = (size_t)model->lay.np;
  uint64_t sum = EMPTY;
#define ADD(field) sum = hash(sum, &(field), sizeof(field))
  sum = hash_group(sum, "belt", &model->belt);
  ADD(model->belt.mesh);
  sum = hash_group(sum, "contact", &model->contact);
  ADD(model->gravity);
  ADD(model->origin);
  const double *const arrays[] = {model->cx, model->cy, model->radius, model->inertia};
  for (int k = 0; k < 4; ++k) {
    sum = hash(sum, arrays[k], np * sizeof(double));
  }
  sum = hash(sum, model->side, np * sizeof *model->side);
  for (size_t j = 0; j < np; ++j) {
    const bd_friction *friction = &model->friction[j];
    ADD(friction->law);
    sum = hash_group(sum, bd_law_name(friction->law), &friction->dahl);
  }
  if (model->drag) {
    sum = hash(sum, model->drag, np * sizeof *model->drag);
  }
  for (int m = 0; m < model->lay.nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    ADD(mount->pulley);
    ADD(mount->kind);
    sum = hash(sum, mount->drawn, offsetof(bd_mounted, has_stops) - offsetof(bd_mounted, drawn));
    ADD(mount->lowest);
    ADD(mount->highest);
    ADD(mount->stop_stiffness);
    ADD(mount->stop_damping);
    sum = hash(sum, mount->t, mount->n_t * sizeof *mount->t);
    sum = hash(sum, mount->points, 2 * mount->n_t * sizeof *mount->points);
  }
  for (int c = 0; c < model->lay.nc; ++c) {
    const bd_coupled *coupled = &model->couplings[c];
    ADD(coupled->pulley);
    ADD(coupled->kind);
    ADD(coupled->sense);
    ADD(coupled->inertia);
    ADD(coupled->stiffness);
    ADD(coupled->damping);
  }
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    ADD(term->kind);
    if (term->kind == BD_TORQUE_PIECEWISE) {
      sum = hash(sum, term->t, term->n_t * sizeof(double));
      sum = hash(sum, term->values, term->n_t * np * sizeof(double));
    } else if (term->kind == BD_TORQUE_VISCOUS) {
      sum = hash(sum, term->coefficients, np * sizeof(double));
    } else if (bd_is_load(term)) {
      ADD(term->pulley);
      ADD(term->of);
      ADD(term->against);
      sum = hash(sum, term->t, 2 * term->n_t * sizeof(double)); /* the factors follow the times */
      sum = hash(sum, term->omega, 2 * term->n_points * sizeof(double));
      sum = hash(sum, term->harmonics.orders, 3 * term->harmonics.n * sizeof(double));
    }
  }
  for (size_t k = 0; k < set->motion.n; ++k) {
    const bd_motion *motion = &set->motion.motions[k];
    ADD(motion->pulley);
    ADD(motion->kind);
    sum = hash(sum, motion->t, 2 * motion->n_t * sizeof(double)); /* the values follow the times */
    sum = hash(sum, motion->harmonics.orders, 3 * motion->harmonics.n * sizeof(double));
    ADD(motion->fade);
  }
  sum = hash(sum, set->breaks, set->n_breaks * sizeof(double));
  const char *method = sim->choice.method[0] ? "auto" : sim->stepper.method->name;
  sum = hash(sum, method, strlen(method));
  ADD(options->rtol);
  ADD(options->step);
  ADD(options->max_step);
  ADD(options->torque_interval);
  ADD(options->ledger);
  ADD(options->guards);
  ADD(sim->t_end);
#undef ADD
  return sum;
}

/* Bits are the same with the same compiler and instruction level alone. */
static uint32_t build_of(const bd_sim *sim) {
  const char *level = sim->stepper.plan.kernels->level;
  uint64_t sum = hash(EMPTY, level, strlen(level));
#ifdef __VERSION__
  sum = hash(sum, __VERSION__, sizeof __VERSION__);
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
  visit_sim(&v, visited, &visited->choice);
  head first = {.format = FORMAT, .size = v.used};
  if (!record) {
    return sizeof first + v.used;
  }
  v = (visitor){.does = WRITE, .out = (char *)record + sizeof first};
  visit_sim(&v, visited, &visited->choice);
  memcpy(first.magic, MAGIC, sizeof first.magic);
  first.build = build_of(sim);
  first.scene = scene_of(sim);
  first.content = hash(EMPTY, v.out, v.used);
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
  visit_sim(&v, sim, &sim->choice);
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
  if (size != sizeof first + v.used || first.content != hash(EMPTY, content, v.used)) {
    return bd_fail(err, BD_ERR_OPTION, "record", "the record is damaged: its check sum is wrong");
  }
  v = (visitor){.does = CHECK, .in = content};
  visit_sim(&v, sim, &sim->choice);
  if (v.bad) {
    return bd_fail(err, BD_ERR_OPTION, "record", "the record is damaged: an index is out of range");
  }
  v = (visitor){.does = READ, .in = content};
  visit_sim(&v, sim, &sim->choice);
  /* made anew: what follows from the time reached */
  sim->next_break = sim->next_sample = 0;
  while (sim->started && sim->next_sample < sim->n_samples &&
         sim->t_sample[sim->next_sample] <= sim->stepper.t) {
    ++sim->next_sample;
  }
  sim->status = sim->started ? BD_MORE : BD_OK;
  sim->stepper.jacobian_known = 0;
  bd_plan_place(&sim->stepper.plan, sim->stepper.t, sim->stepper.y);
  bd_sim *const all[] = {sim, sim->twin.sim, sim->twin.still, sim->twin.missed.pair[0],
                         sim->twin.missed.pair[1]};
  for (size_t k = 0; k < sizeof all / sizeof all[0]; ++k) {
    if (all[k]) {
      bd_stepper_weigh_friction(&all[k]->stepper);
    }
  }
  return BD_OK;
}
