/* SPDX-License-Identifier: MIT
 *
 * Simulation: one run, advanced in chunks of some milliseconds without the GIL.
 *
 * Rules that hold here: every use of the C simulation is inside enter/leave, which set and clear an
 * atomic flag, so a second thread or a torque function that calls back gets a RuntimeError; the
 * arrays the core writes to are held by the Simulation, their users only get views, so they cannot
 * be freed or resized under a run; signals are answered between chunks, where the state is that of
 * a finished step; stop() sets a flag and touches nothing else. Guarded by tests/test_module_run.py
 * and tests/test_threads.py.
 */
#include "binding/binding.h"

#include <limits.h>
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include <time.h>

typedef struct {
  PyObject_HEAD bd_sim *sim; /* NULL only after the garbage collector cleared a cycle */
  bd_settling *settling;     /* what owns it, if it settles; else NULL */
  bd_core_model *model;
  bd_core_call *calls; /* the core's `user` pointers point here */
  Py_ssize_t n_calls;
  PyObject *outputs; /* list of the arrays the core writes to; NULL: no sample times */
  PyObject *passes;
  volatile int *stop; /* set by stop(), in any thread; looked at here and in the core */
  double rate;        /* steps per second of wall time, 0: not known yet */
  int ledger, started;
  atomic_bool busy;
} bd_core_sim;

/* --- one user at a time ---------------------------------------------------------------------- */

static int enter(bd_core_sim *self) {
  if (!self->sim) {
    PyErr_SetString(PyExc_RuntimeError, "the simulation was cleared by the garbage collector");
    return -1;
  }
  if (!atomic_exchange(&self->busy, true)) {
    return 0;
  }
  PyErr_SetString(PyExc_RuntimeError,
                  "the simulation is running in another call (of another thread, or its torque "
                  "function called back)");
  return -1;
}

static void leave(bd_core_sim *self) {
  atomic_store(&self->busy, false);
}

/* --- making one ------------------------------------------------------------------------------ */

static PyObject *passes_of(const bd_sim *sim) {
  PyObject *list = PyList_New(0);
  const char *name;
  for (int k = 0; list && (name = bd_sim_pass(sim, k)); k++) {
    PyObject *text = PyUnicode_FromString(name);
    if (!text || PyList_Append(list, text) < 0) {
      Py_CLEAR(list);
    }
    Py_XDECREF(text);
  }
  PyObject *passes = list ? PyList_AsTuple(list) : NULL;
  Py_XDECREF(list);
  return passes;
}

static void free_core(bd_sim *sim, bd_settling *settling, volatile int *stop) {
  if (settling) {
    bd_settle_free(settling);
  } else {
    bd_sim_free(sim);
  }
  PyMem_Free((void *)stop);
}

/* The Python object around a ready simulation (and the settling that owns it, if any), which it
 * takes over with its flag, as it does the callables of the torque (if any); on failure all are
 * freed. The object comes last, so it is always whole. */
static PyObject *wrap(PyTypeObject *type, bd_sim *sim, bd_settling *settling, volatile int *stop,
                      bd_core_model *model, bd_core_torque *torque) {
  PyObject *passes = passes_of(sim);
  bd_core_sim *self = passes ? (bd_core_sim *)type->tp_alloc(type, 0) : NULL;
  if (!self) {
    Py_XDECREF(passes);
    free_core(sim, settling, stop);
    return NULL;
  }
  self->sim = sim;
  self->settling = settling;
  self->stop = stop;
  self->model = (bd_core_model *)Py_NewRef(model);
  self->passes = passes;
  atomic_init(&self->busy, false);
  if (torque) {
    self->calls = torque->calls;
    self->n_calls = torque->n_calls;
    torque->calls = NULL;
  }
  return (PyObject *)self;
}

/* The keyword options; those not given stay as they are. */
typedef struct {
  PyObject *method, *rtol, *step, *max_step, *max_steps, *ledger, *torque_interval, *guards;
} option_objects;

static int read_options(bd_options *out, const option_objects *in) {
  if (in->method) {
    Py_ssize_t length;
    if (!PyUnicode_Check(in->method)) {
      PyErr_Format(PyExc_TypeError, "method must be a str, got %.100s",
                   Py_TYPE(in->method)->tp_name);
      return -1;
    }
    out->method = PyUnicode_AsUTF8AndSize(in->method, &length);
    if (!out->method) {
      return -1;
    }
    if (strlen(out->method) != (size_t)length) {
      PyErr_SetString(PyExc_ValueError, "method must not contain a null character");
      return -1;
    }
  }
  return (in->rtol && bd_convert_real(in->rtol, "rtol", &out->rtol) < 0) ||
                 (in->step && bd_convert_real(in->step, "step", &out->step) < 0) ||
                 (in->max_step && bd_convert_real(in->max_step, "max_step", &out->max_step) < 0) ||
                 (in->max_steps &&
                  bd_convert_long(in->max_steps, "max_steps", &out->max_steps) < 0) ||
                 (in->torque_interval && bd_convert_real(in->torque_interval, "torque_interval",
                                                         &out->torque_interval) < 0) ||
                 (in->guards && bd_convert_bool(in->guards, "guards", &out->guards) < 0) ||
                 (in->ledger && bd_convert_bool(in->ledger, "ledger", &out->ledger) < 0)
             ? -1
             : 0;
}

/* A flag of its own, for the core keeps its address while the simulation lives. */
static volatile int *new_stop(void) {
  volatile int *stop = PyMem_Calloc(1, sizeof *stop);
  if (!stop) {
    PyErr_NoMemory();
  }
  return stop;
}

static PyObject *sim_new(PyTypeObject *type, PyObject *args, PyObject *keywords) {
  char *names[] = {"model",  "state",    "torque",    "t_end",  "method",      "rtol",
                   "step",   "max_step", "max_steps", "ledger", "breakpoints", "torque_interval",
                   "guards", "motion",   NULL};
  bd_core_module *module = PyType_GetModuleState(type);
  PyObject *model_object, *mapping, *terms, *end, *breakpoints = NULL, *motions = NULL;
  option_objects in = {0};
  if (!module || !PyArg_ParseTupleAndKeywords(args, keywords, "O!OOO|$OOOOOOOOOO:Simulation", names,
                                              module->model_type, &model_object, &mapping, &terms,
                                              &end, &in.method, &in.rtol, &in.step, &in.max_step,
                                              &in.max_steps, &in.ledger, &breakpoints,
                                              &in.torque_interval, &in.guards, &motions)) {
    return NULL;
  }
  bd_core_model *model = (bd_core_model *)model_object;
  bd_options options;
  bd_options_default(&options);
  double t_end;
  if (bd_convert_finite(end, "t_end", &t_end) < 0 || read_options(&options, &in) < 0) {
    return NULL;
  }

  PyObject *self = NULL;
  bd_core_torque torque = {0};
  bd_core_state state;
  if (bd_core_state_read(&state, mapping, &model->info) < 0) {
    return NULL;
  }
  volatile int *stop = new_stop();
  if (!stop || bd_core_torque_read(&torque, terms, breakpoints, motions, model->model, stop) < 0) {
    PyMem_Free((void *)stop);
    goto out;
  }
  bd_error err = {0};
  bd_sim *sim = NULL;
  int code = bd_sim_create(&sim, model->model, &state.state, &torque.torque, t_end, &options, &err);
  if (code < 0) {
    bd_core_raise(code, &err);
    PyMem_Free((void *)stop);
    goto out;
  }
  self = wrap(type, sim, NULL, stop, model, &torque);
  if (self) {
    ((bd_core_sim *)self)->ledger = options.ledger;
  }
out:
  bd_core_state_release(&state);
  bd_core_torque_release(&torque);
  return self;
}

PyDoc_STRVAR(settle_doc,
             "settle($type, /, model, state=None, *, friction=False, free_pulleys=False,\n"
             "       offset=None, move_time=0.0, shift=0.0, tolerance=..., max_time=0.0,\n"
             "       speed=0.0)\n--\n\n"
             "A simulation that brings the belt to rest under preload.\n\n"
             "state: where to begin, a mapping as of state(); None: on the belt line. friction:\n"
             "friction acts meanwhile. free_pulleys: pulleys may turn. offset: (n_p, 2) [m], the\n"
             "centres start displaced by this and move in during move_time [s] (0: chosen).\n"
             "shift: link 0 is laid this far past its place along the belt line [m].\n"
             "tolerance: at rest when the unbalanced force is below this times the mean tension.\n"
             "max_time: give up after this much simulated time [s] (0: chosen). speed: of a belt\n"
             "that runs along itself, in its spans [m/s].\n"
             "Raises TypeError or ValueError naming the argument.");

static PyObject *sim_settle(PyObject *type, PyObject *args, PyObject *keywords) {
  char *names[] = {"model", "state",     "friction", "free_pulleys", "offset", "move_time",
                   "shift", "tolerance", "max_time", "speed",        NULL};
  bd_core_module *module = PyType_GetModuleState((PyTypeObject *)type);
  PyObject *model_object, *mapping = Py_None, *friction = NULL, *free_pulleys = NULL,
                          *offset = Py_None, *move_time = NULL, *shift = NULL, *tolerance = NULL,
                          *max_time = NULL, *speed = NULL;
  if (!module || !PyArg_ParseTupleAndKeywords(args, keywords, "O!|O$OOOOOOOO:settle", names,
                                              module->model_type, &model_object, &mapping,
                                              &friction, &free_pulleys, &offset, &move_time, &shift,
                                              &tolerance, &max_time, &speed)) {
    return NULL;
  }
  bd_core_model *model = (bd_core_model *)model_object;
  bd_settle_options options;
  bd_settle_options_default(&options);
  if ((friction && bd_convert_bool(friction, "friction", &options.friction) < 0) ||
      (free_pulleys && bd_convert_bool(free_pulleys, "free_pulleys", &options.free_pulleys) < 0) ||
      (move_time && bd_convert_real(move_time, "move_time", &options.move_time) < 0) ||
      (shift && bd_convert_real(shift, "shift", &options.shift) < 0) ||
      (tolerance && bd_convert_real(tolerance, "tolerance", &options.tolerance) < 0) ||
      (max_time && bd_convert_real(max_time, "max_time", &options.max_time) < 0) ||
      (speed && bd_convert_real(speed, "speed", &options.speed) < 0)) {
    return NULL;
  }

  PyObject *self = NULL;
  bd_core_state state = {0};
  PyArrayObject *offsets = NULL;
  if (mapping != Py_None && bd_core_state_read(&state, mapping, &model->info) < 0) {
    return NULL;
  }
  if (offset != Py_None) {
    const npy_intp shape[2] = {model->info.n_pulleys, 2};
    offsets = bd_convert_array(offset, "offset", 2, shape);
    if (!offsets) {
      goto out;
    }
    options.offset = PyArray_DATA(offsets);
  }
  bd_error err = {0};
  bd_settling *settling = NULL;
  int code = bd_settle_create(&settling, model->model, mapping == Py_None ? NULL : &state.state,
                              &options, &err);
  volatile int *stop = code < 0 ? NULL : new_stop();
  if (code < 0) {
    bd_core_raise(code, &err);
  } else if (!stop) {
    bd_settle_free(settling);
  } else {
    self = wrap((PyTypeObject *)type, bd_settle_sim(settling), settling, stop, model, NULL);
  }
out:
  Py_XDECREF(offsets);
  bd_core_state_release(&state);
  return self;
}

static int sim_traverse(PyObject *object, visitproc visit, void *arg) {
  bd_core_sim *self = (bd_core_sim *)object;
  Py_VISIT(Py_TYPE(object));
  Py_VISIT(self->model);
  Py_VISIT(self->outputs);
  for (Py_ssize_t i = 0; i < self->n_calls; i++) {
    Py_VISIT(self->calls[i].callable);
    Py_VISIT(self->calls[i].theta);
    Py_VISIT(self->calls[i].omega);
  }
  return 0;
}

/* The C simulation goes first: it points into everything else. */
static int sim_clear(PyObject *object) {
  bd_core_sim *self = (bd_core_sim *)object;
  bd_core_call *calls = self->calls;
  Py_ssize_t n_calls = self->n_calls;
  free_core(self->sim, self->settling, self->stop);
  self->sim = NULL;
  self->settling = NULL;
  self->stop = NULL;
  self->calls = NULL;
  self->n_calls = 0;
  bd_core_calls_free(calls, n_calls);
  Py_CLEAR(self->outputs);
  Py_CLEAR(self->model);
  return 0;
}

static void sim_dealloc(PyObject *object) {
  bd_core_sim *self = (bd_core_sim *)object;
  PyTypeObject *type = Py_TYPE(object);
  PyObject_GC_UnTrack(object);
  sim_clear(object);
  Py_CLEAR(self->passes);
  type->tp_free(object);
  Py_DECREF(type);
}

/* --- samples --------------------------------------------------------------------------------- */

PyDoc_STRVAR(sample_doc,
             "sample($self, /, t, outputs=None)\n--\n\n"
             "Attach sample times; once, before the first advance().\n\n"
             "t: times [s], shape (n_t,), non-decreasing and within the run. outputs: names of\n"
             "those to compute and keep; None: all but \"span_tension\". Returns a dict of\n"
             "arrays (n_t, width): OUTPUTS by name (float64; \"energy\" only with the ledger),\n"
             "\"pulley\" (int32: the pulley the link touches, or -1), \"span_tension\" (as\n"
             "span_tension()). The run fills them row by\n"
             "row; rows not yet written hold NaN and -1. They stay valid after the simulation.\n"
             "Raises TypeError or ValueError for bad times, RuntimeError if called too late,\n"
             "KeyboardInterrupt while it fills them: it may then be called again.");

static PyObject *sim_sample(PyObject *object, PyObject *args, PyObject *keywords) {
  char *names[] = {"t", "outputs", NULL};
  bd_core_sim *self = (bd_core_sim *)object;
  const npy_intp any = BD_ANY;
  PyObject *times, *outputs = Py_None;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O|O:sample", names, &times, &outputs)) {
    return NULL;
  }
  PyObject *wanted = outputs == Py_None ? NULL : bd_core_output_names(outputs);
  if (outputs != Py_None && !wanted) {
    return NULL;
  }
  PyArrayObject *t = bd_convert_array(times, "t_eval", 1, &any);
  if (!t) {
    Py_XDECREF(wanted);
    return NULL;
  }
  PyObject *dict = NULL, *keep = NULL;
  if (enter(self) < 0) {
    goto out;
  }
  bd_error err = {0};
  bd_output output = {0};
  int code = BD_OK, ready = 0;
  if (self->outputs || self->started) {
    PyErr_SetString(PyExc_RuntimeError, self->outputs ? "the sample times are set already"
                                                      : "sample times must be set before the run");
  } else if ((dict = PyDict_New()) && (keep = PyList_New(0))) {
    ready = !bd_core_output_new(&output, keep, dict, &self->model->info,
                                self->ledger ? bd_model_energy_terms(self->model->model, NULL) : 0,
                                PyArray_DIM(t, 0), wanted);
  }
  if (ready) {
    code = bd_sim_set_output(self->sim, (size_t)PyArray_DIM(t, 0), PyArray_DATA(t), &output, &err);
  }
  if (!ready || code < 0) {
    Py_CLEAR(dict);
  } else {
    self->outputs = Py_NewRef(keep);
  }
  leave(self);
  if (code < 0) {
    bd_core_raise(code, &err);
  }
out:
  Py_XDECREF(keep);
  Py_XDECREF(wanted);
  Py_DECREF(t);
  return dict;
}

/* --- running --------------------------------------------------------------------------------- */

/* A chunk is long against the cost of taking the GIL, short against a user's patience. */
static const double CHUNK_SECONDS = 8e-3, LEAST_SECONDS = 1e-3;
enum { FIRST_CHUNK = 8, MOST_STEPS = 1 << 20 };

static double clock_seconds(void) {
  struct timespec now;
#ifdef CLOCK_MONOTONIC
  clock_gettime(CLOCK_MONOTONIC, &now);
#else
  timespec_get(&now, TIME_UTC);
#endif
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Steps for a chunk, from the rate of the last one and the wall time left. */
static long chunk_steps(double rate, double left) {
  if (!(rate > 0)) {
    return FIRST_CHUNK;
  }
  double steps = rate * fmin(fmax(left, LEAST_SECONDS), CHUNK_SECONDS);
  return (long)fmin(fmax(steps, 1), MOST_STEPS);
}

/* The rate after a chunk: as measured, but no more than four times the last, for a clock that is
 * coarse and a chunk that is short. */
static double next_rate(double rate, long steps, double seconds) {
  double measured = (double)steps / fmax(seconds, 1e-6);
  double most = rate > 0 ? 4 * rate : 4 * FIRST_CHUNK / CHUNK_SECONDS;
  return fmin(measured, most);
}

/* Without the GIL unless there is Python to call, whose own code lets other threads in. The time
 * waited for the GIL is not the chunk's. */
static int advance_chunk(bd_core_sim *self, double left, bd_error *err) {
  const long steps = chunk_steps(self->rate, left);
  PyThreadState *thread = self->n_calls ? NULL : PyEval_SaveThread();
  const double begin = clock_seconds();
  int code = self->settling ? bd_settle_advance(self->settling, steps, err)
                            : bd_sim_advance(self->sim, steps, err);
  self->rate = next_rate(self->rate, steps, clock_seconds() - begin);
  if (thread) {
    PyEval_RestoreThread(thread);
  }
  return code;
}

PyDoc_STRVAR(advance_doc,
             "advance($self, /, seconds)\n--\n\n"
             "Run for about this much wall time [s]; True at the end of the run, else False.\n\n"
             "seconds: >= 0, may be inf; at least one step is made. Runs without the GIL unless a\n"
             "torque is a Python callable, and answers signals every few milliseconds: after\n"
             "KeyboardInterrupt the state is that of a finished step and the run can go on. An\n"
             "exception of a torque callable comes out unchanged and ends the run. After stop()\n"
             "it raises KeyboardInterrupt, whenever called. Raises SimulationError if the run\n"
             "cannot go on, again whenever called again, and RuntimeError if the simulation is\n"
             "running in another call.");

static PyObject *sim_advance(PyObject *object, PyObject *args, PyObject *keywords) {
  char *names[] = {"seconds", NULL};
  bd_core_sim *self = (bd_core_sim *)object;
  PyObject *argument;
  double seconds;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O:advance", names, &argument) ||
      bd_convert_real(argument, "seconds", &seconds) < 0) {
    return NULL;
  }
  if (!(seconds >= 0)) {
    PyErr_Format(PyExc_ValueError, "seconds must be >= 0, got %R", argument);
    return NULL;
  }
  if (enter(self) < 0) {
    return NULL;
  }
  self->started = 1;
  bd_error err = {0};
  int code, interrupted = 0;
  double now = clock_seconds();
  const double end = now + seconds;
  do {
    if (bd_core_check_stop(self->stop) < 0) {
      code = BD_MORE;
      interrupted = 1;
      break;
    }
    code = advance_chunk(self, end - now, &err);
    now = clock_seconds();
    if (code == BD_MORE && self->n_calls) {
      /* A callable written in C runs no bytecode: let other threads in here. */
      PyEval_RestoreThread(PyEval_SaveThread());
    }
    interrupted = code == BD_MORE && PyErr_CheckSignals() < 0;
  } while (code == BD_MORE && !interrupted && now < end);
  leave(self);
  if (interrupted || (code < 0 && bd_error_kind(code) == BD_KIND_CALL && !PyErr_Occurred() &&
                      bd_core_check_stop(self->stop) < 0)) {
    return NULL;
  }
  return code < 0 ? bd_core_raise(code, &err) : PyBool_FromLong(code == BD_OK);
}

PyDoc_STRVAR(stop_doc,
             "stop($self, /)\n--\n\n"
             "End the run soon: for other threads, and for callbacks that cannot raise.\n\n"
             "advance() then raises KeyboardInterrupt: after the steps of some milliseconds that\n"
             "it is at, or after the next call of a torque function. It cannot be taken back.\n"
             "The state is that of a finished step. Never waits, and may be called at any time.");

static PyObject *sim_stop(PyObject *object, PyObject *Py_UNUSED(none)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (self->stop) { /* not cleared by the garbage collector */
    *self->stop = 1;
  }
  Py_RETURN_NONE;
}

/* --- looking --------------------------------------------------------------------------------- */

PyDoc_STRVAR(state_doc,
             "state($self, /)\n--\n\n"
             "The state now, a dict of new arrays: STATE_FIELDS by name, and \"t\" [s].\n\n"
             "Shapes: LINKS (n_b,), SLOTS (n_slots * n_b,) slot by slot, PULLEYS (n_p,),\n"
             "MOUNTS (n_m,).\n"
             "Raises RuntimeError while the simulation is running.");

static PyObject *sim_state(PyObject *object, PyObject *Py_UNUSED(none)) {
  bd_core_sim *self = (bd_core_sim *)object;
  bd_core_state state;
  if (enter(self) < 0) {
    return NULL;
  }
  PyObject *dict = NULL;
  int code = BD_OK;
  if (!bd_core_state_new(&state, &self->model->info)) {
    code = bd_sim_state(self->sim, &state.state);
    if (code >= 0) {
      dict = bd_core_state_dict(&state, 1);
    }
    bd_core_state_release(&state);
  }
  leave(self);
  if (code < 0) {
    const bd_error err = {.t = NAN, .body = -1, .pulley = -1, .value = NAN};
    bd_core_raise(code, &err);
  }
  return dict;
}

PyDoc_STRVAR(
    export_doc,
    "export_record($self, /)\n--\n\n"
    "Everything that the run needs to go on bit for bit, as bytes.\n\n"
    "state() has no step size, history, choice of method and the like. Raises RuntimeError\n"
    "while the simulation is running or if it settles or has\n"
    "failed.");

static PyObject *sim_export(PyObject *object, PyObject *Py_UNUSED(none)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  PyObject *bytes = NULL;
  if (self->settling) {
    PyErr_SetString(PyExc_RuntimeError, "settling has no restart record: begin it anew");
  } else {
    size_t size = bd_sim_export(self->sim, NULL);
    if (size > 0) {
      bytes = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)size);
    } else {
      PyErr_SetString(PyExc_RuntimeError,
                      "a run that ended in an error or in an exception of its torque function has "
                      "no restart record: it may have been in the middle of a step");
    }
  }
  if (bytes) {
    bd_sim_export(self->sim, PyBytes_AS_STRING(bytes));
  }
  leave(self);
  return bytes;
}

PyDoc_STRVAR(
    import_doc,
    "import_record($self, record, /)\n--\n\n"
    "Go on from a record of export_record(), of this or of another process.\n\n"
    "The simulation must be new, made with the same model, torque, t_end and options; its\n"
    "state is replaced. Sample times are set before; those up to the record's time are\n"
    "left out. Raises TypeError for what is no bytes-like object, ValueError for a record\n"
    "that is damaged, or of another run or other kernels, RuntimeError if it is too late.");

static PyObject *sim_import(PyObject *object, PyObject *record) {
  bd_core_sim *self = (bd_core_sim *)object;
  Py_buffer view;
  if (PyObject_GetBuffer(record, &view, PyBUF_SIMPLE) < 0) {
    return NULL;
  }
  int code = -1;
  bd_error err = {0};
  if (enter(self) == 0) {
    code = bd_sim_import(self->sim, view.buf, (size_t)view.len, &err);
    leave(self);
    if (code < 0) {
      bd_core_raise(code, &err);
    } else {
      self->started = 1;
    }
  }
  PyBuffer_Release(&view);
  return code < 0 ? NULL : Py_NewRef(Py_None);
}

static PyObject *sim_time(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  double t = bd_sim_time(self->sim);
  leave(self);
  return PyFloat_FromDouble(t);
}

static PyObject *sim_samples(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  size_t n = bd_sim_samples(self->sim);
  leave(self);
  return PyLong_FromSize_t(n);
}

static PyObject *sim_stats(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  bd_stats stats = {0};
  bd_sim_stats(self->sim, &stats);
  leave(self);
  PyObject *dict = PyDict_New();
  if (!dict) {
    return NULL;
  }
#define X(type, name, text)                                                                        \
  if (bd_core_set(dict, #name, BD_CORE_NUMBER(stats.name)) < 0)                                    \
    goto fail;
  BD_STATS(X)
#undef X
  return dict;
fail:
  Py_DECREF(dict);
  return NULL;
}

static PyObject *sim_method(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  const char *name = bd_sim_method(self->sim);
  leave(self);
  return PyUnicode_FromString(name);
}

static PyObject *sim_choice(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  char text[384];
  bd_sim_explain(self->sim, text, sizeof text);
  leave(self);
  return PyUnicode_FromString(text);
}

static PyObject *warning_dict(const bd_warning *w, const bd_model *model) {
  bd_label where = {""};
  if (w->pulley >= 0) {
    where = bd_pulley_label(model, w->pulley);
  } else if (w->body >= 0) {
    PyOS_snprintf(where.text, sizeof where.text, "link %d", w->body);
  }
  PyObject *t = isnan(w->t) ? Py_NewRef(Py_None) : PyFloat_FromDouble(w->t);
  return t ? Py_BuildValue("{s:s, s:s, s:N, s:s, s:O}", "code", bd_warning_code(w->code), "text",
                           w->message, "t", t, "where", where.text, "accuracy",
                           bd_warning_accuracy(w->code) ? Py_True : Py_False)
           : NULL;
}

static PyObject *sim_warnings(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  PyObject *list = PyList_New(0);
  bd_warning w;
  for (size_t k = 0; list && bd_sim_warning(self->sim, k, &w); k++) {
    PyObject *dict = warning_dict(&w, self->model->model);
    if (!dict || PyList_Append(list, dict) < 0) {
      Py_CLEAR(list);
    }
    Py_XDECREF(dict);
  }
  leave(self);
  return list;
}

/* Fixed when the simulation is made, so this may be read while it runs. */
static PyObject *sim_passes(PyObject *object, void *Py_UNUSED(closure)) {
  return Py_NewRef(((bd_core_sim *)object)->passes);
}

static PyObject *sim_effects(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_sim *self = (bd_core_sim *)object;
  int rows[BD_MAX_PASSES], n = 0;
  while (self->sim && n < BD_MAX_PASSES && (rows[n] = bd_sim_effect(self->sim, n)) >= 0) {
    n++;
  }
  PyObject *tuple = PyTuple_New(n);
  for (int k = 0; tuple && k < n; k++) {
    PyObject *row = PyLong_FromLong(rows[k]);
    if (row) {
      PyTuple_SET_ITEM(tuple, k, row);
    } else {
      Py_CLEAR(tuple);
    }
  }
  return tuple;
}

static PyObject *sim_sizes(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (enter(self) < 0) {
    return NULL;
  }
  bd_sizes sizes;
  bd_sim_sizes(self->sim, &sizes);
  leave(self);
  return Py_BuildValue("{s:n, s:n, s:n}", "state", (Py_ssize_t)sizes.state, "works",
                       (Py_ssize_t)sizes.works, "bytes", (Py_ssize_t)sizes.bytes);
}

PyDoc_STRVAR(time_passes_doc,
             "time_passes($self, rounds, /)\n--\n\n"
             "Measure what the passes of a step cost at the state now reached, and end the run.\n\n"
             "rounds: 1 to 101, over all passes, of which medians are taken; some 2 ms each. A\n"
             "list of (name, calls a step, seconds a call) in the order of a step, last the whole\n"
             "step, of which the others are parts. Torque functions are called. Raises ValueError\n"
             "for bad rounds, RuntimeError before the first step.");

static PyObject *sim_time_passes(PyObject *object, PyObject *argument) {
  bd_core_sim *self = (bd_core_sim *)object;
  long rounds;
  if (bd_convert_long(argument, "rounds", &rounds) < 0 || enter(self) < 0) {
    return NULL;
  }
  bd_pass_time times[BD_MAX_PASSES];
  bd_error err = {0};
  int n = 0;
  const int asked = rounds > INT_MAX ? INT_MAX : rounds < 0 ? 0 : (int)rounds;
  PyThreadState *thread = self->n_calls ? NULL : PyEval_SaveThread();
  const int code = bd_sim_time_passes(self->sim, asked, times, &n, &err);
  if (thread) {
    PyEval_RestoreThread(thread);
  }
  leave(self);
  if (code < 0) {
    return bd_core_raise(code, &err);
  }
  PyObject *list = PyList_New(n);
  for (int k = 0; list && k < n; k++) {
    PyObject *row = Py_BuildValue("(sdd)", times[k].name, times[k].calls, times[k].seconds);
    if (row) {
      PyList_SET_ITEM(list, k, row);
    } else {
      Py_CLEAR(list);
    }
  }
  return list;
}

/* --- the type -------------------------------------------------------------------------------- */

static PyMethodDef sim_methods[] = {
    {"settle", (PyCFunction)(void (*)(void))sim_settle, METH_VARARGS | METH_KEYWORDS | METH_CLASS,
     settle_doc},
    {"sample", (PyCFunction)(void (*)(void))sim_sample, METH_VARARGS | METH_KEYWORDS, sample_doc},
    {"advance", (PyCFunction)(void (*)(void))sim_advance, METH_VARARGS | METH_KEYWORDS,
     advance_doc},
    {"stop", sim_stop, METH_NOARGS, stop_doc},
    {"state", sim_state, METH_NOARGS, state_doc},
    {"export_record", sim_export, METH_NOARGS, export_doc},
    {"import_record", sim_import, METH_O, import_doc},
    {"time_passes", sim_time_passes, METH_O, time_passes_doc},
    {NULL, NULL, 0, NULL},
};

static PyGetSetDef sim_properties[] = {
    {"time", sim_time, NULL, "Simulated time reached [s]. RuntimeError while running.", NULL},
    {"samples", sim_samples, NULL, "Finished sample rows. RuntimeError while running.", NULL},
    {"method", sim_method, NULL, "Integration method in use. RuntimeError while running.", NULL},
    {"choice", sim_choice, NULL, "Why that method, a sentence. RuntimeError while running.", NULL},
    {"passes", sim_passes, NULL, "Names of the passes of the plan, in order.", NULL},
    {"effects", sim_effects, NULL, "Rows of EFFECTS that the plan has, in order of its passes.",
     NULL},
    {"sizes", sim_sizes, NULL,
     "Numbers in the state vector and works in it, bytes of the simulation. RuntimeError while "
     "running.",
     NULL},
    {"stats", sim_stats, NULL, "Counters as in STATS, a new dict. RuntimeError while running.",
     NULL},
    {"warnings", sim_warnings, NULL,
     "What was noticed so far: dicts of code, text, t, where, accuracy. RuntimeError while "
     "running.",
     NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

PyDoc_STRVAR(
    sim_doc,
    "Simulation(model, state, torque, t_end, *, method='auto', rtol=..., step=0.0,\n"
    "           max_step=0.0, max_steps=0, ledger=True, breakpoints=(),\n"
    "           torque_interval=..., guards=True, motion=())\n--\n\n"
    "One run; not to be used by two threads at once (RuntimeError).\n\n"
    "state: mapping as of state(), copied. torque: sequence of terms that add up,\n"
    "(\"piecewise\", t, values (n_t, n_p)), (\"viscous\", coefficients (n_p,)),\n"
    "(\"function\", address, user_address) of C functions the caller keeps alive, or\n"
    "(\"call\", f) with f(t, theta, omega) -> n_p torques [N m]; theta [rad] and omega\n"
    "[rad/s] are read-only arrays (n_p,). t_end: [s]. rtol: error asked for\n"
    "(adaptive methods). step: of \"rk4\", \"lbdf2\", \"lie\", or the first step [s], 0: chosen.\n"
    "max_step [s] and max_steps: 0: none. ledger: carry the energy ledger. breakpoints:\n"
    "more times [s] at which to stop exactly. torque_interval: longest time between two\n"
    "calls of a function [s]. guards: False, to measure what they cost. motion: of pulleys,\n"
    "(pulley, \"piecewise\", t, values) of the speed [rad/s], (pulley, \"speed\", f) or\n"
    "(pulley, \"angle\", f) with f(t) a number, called for times within the run, some twice.\n"
    "Raises TypeError or ValueError naming the argument.");

static PyType_Slot sim_slots[] = {
    {Py_tp_doc, (void *)sim_doc},   {Py_tp_new, sim_new},
    {Py_tp_traverse, sim_traverse}, {Py_tp_clear, sim_clear},
    {Py_tp_dealloc, sim_dealloc},   {Py_tp_methods, sim_methods},
    {Py_tp_getset, sim_properties}, {0, NULL},
};

static PyType_Spec sim_spec = {
    .name = "beltdyn._core.Simulation",
    .basicsize = sizeof(bd_core_sim),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_IMMUTABLETYPE,
    .slots = sim_slots,
};

int bd_core_add_simulation(PyObject *module, bd_core_module *state) {
  PyObject *type = PyType_FromModuleAndSpec(module, &sim_spec, NULL);
  state->simulation_type = (PyTypeObject *)type; /* the reference is the module's */
  return type ? PyModule_AddType(module, state->simulation_type) : -1;
}
