/* SPDX-License-Identifier: MIT
 *
 * Model, the constant scene; and states going in and out as mappings of arrays. Guarded by
 * tests/test_module.py (arguments) and tests/test_lifetime.py (references).
 */
#include "binding/binding.h"

#include <stddef.h>
#include <string.h>

/* --- states ---------------------------------------------------------------------------------- */

/* The name, length kind and pointer of every state field, in the order of BD_STATE_FIELDS. */
static const struct {
  const char *name;
  int size;
  size_t offset;
} state_fields[] = {
#define X(symbol, name, size, scale, unit, text) {#name, BD_SIZE_##size, offsetof(bd_state, name)},
    BD_STATE_FIELDS(X)
#undef X
};

/* The dict takes an array (NULL: failed already) of a field, and the state its numbers. */
static int put_array(PyObject *dict, bd_state *out, int k, PyArrayObject *array) {
  double *data = array ? PyArray_DATA(array) : NULL;
  memcpy((char *)out + state_fields[k].offset, &data, sizeof data);
  return bd_core_set(dict, state_fields[k].name, (PyObject *)array);
}

/* What a plain dict lacks is a ValueError, not a KeyError. */
static PyObject *get_field(PyObject *mapping, const char *name) {
  PyObject *value = PyMapping_GetItemString(mapping, name);
  if (!value && PyErr_ExceptionMatches(PyExc_KeyError)) {
    PyErr_Format(PyExc_ValueError, "state lacks '%s'", name);
  }
  return value;
}

/* mapping NULL: fresh arrays, filled with 0, as where it lacks a field that has no numbers. */
static int read_field(PyObject *dict, bd_state *out, int k, PyObject *mapping,
                      const bd_info *info) {
  const char *field = state_fields[k].name;
  npy_intp length = (npy_intp)bd_size(info, state_fields[k].size);
  char name[BD_NAME_SIZE];
  if (!mapping || (length == 0 && !PyMapping_HasKeyString(mapping, field))) {
    return put_array(dict, out, k, (PyArrayObject *)PyArray_ZEROS(1, &length, NPY_DOUBLE, 0));
  }
  PyOS_snprintf(name, sizeof name, "state '%s'", field);
  PyObject *value = get_field(mapping, field);
  PyArrayObject *array = value ? bd_convert_array(value, name, 1, &length) : NULL;
  Py_XDECREF(value);
  return put_array(dict, out, k, array);
}

static PyObject *read_fields(bd_state *out, PyObject *mapping, const bd_info *info) {
  PyObject *dict = PyDict_New();
  for (size_t k = 0; dict && k < sizeof state_fields / sizeof state_fields[0]; k++) {
    if (read_field(dict, out, (int)k, mapping, info) < 0) {
      Py_CLEAR(dict);
    }
  }
  return dict;
}

PyObject *bd_core_state_read(bd_state *out, PyObject *mapping, const bd_info *info) {
  /* What the language and NumPy index by number passes PyMapping_Check too. */
  if (!PyMapping_Check(mapping) || PyList_Check(mapping) || PyTuple_Check(mapping) ||
      PyUnicode_Check(mapping) || PyBytes_Check(mapping) || PyArray_CheckAnyScalar(mapping) ||
      PyArray_Check(mapping)) {
    bd_convert_refuse(mapping, "state", "a mapping of arrays by name");
    return NULL;
  }
  PyObject *value = get_field(mapping, "t");
  const int failed = value ? bd_convert_finite(value, "state 't'", &out->t) : -1;
  Py_XDECREF(value);
  return failed ? NULL : read_fields(out, mapping, info);
}

PyObject *bd_core_state_new(bd_state *out, const bd_info *info) {
  return read_fields(out, NULL, info);
}

PyObject *bd_core_state_timed(PyObject *fields, const bd_state *state) {
  PyObject *dict = fields ? Py_BuildValue("{s:d}", "t", state->t) : NULL;
  if (dict && PyDict_Update(dict, fields) < 0) {
    Py_CLEAR(dict);
  }
  Py_XDECREF(fields);
  return dict;
}

/* --- Model ----------------------------------------------------------------------------------- */

const char *const bd_core_meshes[] = {
    [BD_MESH_PAPER] = "paper", [BD_MESH_JOINT] = "joint", [BD_MESH_ALE] = "ale", NULL};
const char *const bd_core_belt_models[] = {
    [BD_BELT_AUTO] = "auto", [BD_BELT_LINKS] = "links", [BD_BELT_STRING] = "string", NULL};

/* The place of a name in a list of them, which `choices` is in words. */
static int read_choice(const char *field, const char *name, const char *const *names,
                       const char *choices, int *out) {
  for (int k = 0; names[k]; ++k) {
    if (strcmp(name, names[k]) == 0) {
      *out = k;
      return 0;
    }
  }
  PyErr_Format(PyExc_ValueError, "belt.%s must be %s, got \"%.100s\"", field, choices, name);
  return -1;
}

/* All in tp_new, the object last: one that exists is a whole one. */
static PyObject *model_new(PyTypeObject *type, PyObject *args, PyObject *keywords) {
  PyObject *belt, *centers, *radii, *inertias, *contact, *default_friction, *gravity;
  bd_core_pulley_parts parts = {Py_None, Py_None, Py_None, Py_None, Py_None, Py_None};
  const char *mesh = "paper", *belt_model = "links";
  const bd_argument rows[] = {
      {"belt", BD_OBJECT, &belt},
      {"centers", BD_OBJECT, &centers},
      {"radii", BD_OBJECT, &radii},
      {"inertias", BD_OBJECT, &inertias},
      {"contact", BD_OBJECT, &contact},
      {"friction", BD_OBJECT, &default_friction},
      {"gravity", BD_OBJECT, &gravity},
      {"drag", BD_OBJECT, &parts.drag},
      {"pulley_friction", BD_OBJECT, &parts.friction},
      {"mesh", BD_STR, &mesh},
      {"outside", BD_OBJECT, &parts.outside},
      {"names", BD_OBJECT, &parts.names},
      {"mounts", BD_OBJECT, &parts.mounts},
      {"model", BD_STR, &belt_model},
      {"couplings", BD_OBJECT, &parts.couplings},
      {0},
  };
  bd_scene scene = {0};
  bd_friction friction = {0};
  bd_core_model *self = NULL;
  if (bd_convert_arguments(args, keywords, "Model", 7, 15, rows) < 0 ||
      bd_core_read_group(belt, "belt", "belt", &scene.belt) < 0 ||
      bd_core_read_group(contact, "contact", "contact", &scene.contact) < 0 ||
      bd_core_read_friction(default_friction, "friction", &friction) < 0 ||
      bd_convert_numbers(gravity, "gravity", 2, scene.gravity) < 0) {
    return NULL;
  }
  scene.friction = default_friction == Py_None ? NULL : &friction;
  PyObject *keep = PyList_New(0);
  bd_pulley *pulleys =
      keep ? bd_core_read_pulleys(centers, radii, inertias, &parts, keep, &scene.n_pulleys) : NULL;
  scene.pulleys = pulleys;
  if (pulleys &&
      read_choice("mesh", mesh, bd_core_meshes, "\"joint\", \"paper\" or \"ale\"",
                  &scene.belt.mesh) == 0 &&
      read_choice("model", belt_model, bd_core_belt_models, "\"auto\", \"links\" or \"string\"",
                  &scene.belt.model) == 0) {
    bd_error err = {0};
    bd_model *model = NULL;
    const int code = bd_model_create(&model, &scene, &err);
    self = code < 0 ? (void *)bd_core_raise(code, &err) : (bd_core_model *)type->tp_alloc(type, 0);
    if (self) {
      self->model = model;
      bd_model_info(model, &self->info);
    } else {
      bd_model_free(model);
    }
  }
  PyMem_Free(pulleys);
  Py_XDECREF(keep);
  return (PyObject *)self;
}

static int model_traverse(PyObject *self, visitproc visit, void *arg) {
  Py_VISIT(Py_TYPE(self));
  return 0;
}

static void model_dealloc(PyObject *object) {
  bd_core_model *self = (bd_core_model *)object;
  PyTypeObject *type = Py_TYPE(object);
  PyObject_GC_UnTrack(object);
  bd_model_free(self->model);
  type->tp_free(object);
  Py_DECREF(type);
}

static PyObject *model_check_geometry(PyObject *self, PyObject *Py_UNUSED(none)) {
  bd_error err = {0};
  const int code = bd_model_check_geometry(((bd_core_model *)self)->model, &err);
  return bd_core_result(Py_NewRef(Py_None), code, &err);
}

static PyObject *model_rate(PyObject *object, PyObject *args, PyObject *keywords) {
  const bd_core_model *self = (bd_core_model *)object;
  const npy_intp n_pulleys = self->info.n_pulleys;
  PyObject *mapping, *torque;
  const bd_argument rows[] = {{"state", BD_OBJECT, &mapping}, {"torque", BD_OBJECT, &torque}, {0}};
  if (bd_convert_arguments(args, keywords, "rate", 2, 2, rows) < 0) {
    return NULL;
  }
  bd_state state, rate;
  bd_error err = {0};
  PyObject *given = bd_core_state_read(&state, mapping, &self->info);
  PyArrayObject *values = given ? bd_convert_array(torque, "torque", 1, &n_pulleys) : NULL;
  PyObject *result = values ? bd_core_state_new(&rate, &self->info) : NULL;
  if (result) {
    const int code = bd_model_rate(self->model, &state, PyArray_DATA(values), &rate, &err);
    result = bd_core_result(result, code, &err);
  }
  Py_XDECREF(values);
  Py_XDECREF(given);
  return result;
}

static PyObject *model_torques(PyObject *object, PyObject *args, PyObject *keywords) {
  static const int never = 0;
  const bd_core_model *self = (bd_core_model *)object;
  const npy_intp n_pulleys = self->info.n_pulleys;
  PyObject *terms, *motions, *angles, *speeds, *result = NULL;
  double t, until;
  const bd_argument rows[] = {{"torque", BD_OBJECT, &terms},
                              {"motion", BD_OBJECT, &motions},
                              {"t", BD_FINITE, &t},
                              {"until", BD_FINITE, &until},
                              {"theta", BD_OBJECT, &angles},
                              {"omega", BD_OBJECT, &speeds},
                              {0}};
  if (bd_convert_arguments(args, keywords, "torques", 6, 6, rows) < 0) {
    return NULL;
  }
  bd_core_torque given;
  bd_error err = {0};
  PyArrayObject *theta = bd_convert_array(angles, "theta", 1, &n_pulleys);
  PyArrayObject *omega = theta ? bd_convert_array(speeds, "omega", 1, &n_pulleys) : NULL;
  PyArrayObject *moved = omega ? (PyArrayObject *)PyArray_NewCopy(omega, NPY_CORDER) : NULL;
  PyArrayObject *torque =
      moved ? (PyArrayObject *)PyArray_SimpleNew(1, &n_pulleys, NPY_DOUBLE) : NULL;
  if (torque) {
    if (bd_core_torque_read(&given, terms, NULL, motions, self->model, &never) == 0) {
      const int code = bd_model_torques(self->model, &given.torque, t, until, PyArray_DATA(theta),
                                        PyArray_DATA(moved), PyArray_DATA(torque), &err);
      result = bd_core_result(Py_BuildValue("(OO)", torque, moved), code, &err);
    }
    bd_core_torque_release(&given);
  }
  Py_XDECREF(theta);
  Py_XDECREF(omega);
  Py_XDECREF(moved);
  Py_XDECREF(torque);
  return result;
}

static PyObject *model_observe(PyObject *object, PyObject *mapping) {
  const bd_core_model *self = (bd_core_model *)object;
  bd_state state;
  bd_output output = {0};
  bd_error err = {0};
  PyObject *given = bd_core_state_read(&state, mapping, &self->info);
  PyObject *keep = given ? PyList_New(0) : NULL, *dict = keep ? PyDict_New() : NULL;
  if (dict && bd_core_output_new(&output, keep, dict, &self->info, 0, 1, NULL) < 0) {
    Py_CLEAR(dict);
  }
  if (dict) {
    dict = bd_core_result(dict, bd_model_observe(self->model, &state, &output, &err), &err);
  }
  Py_XDECREF(keep);
  Py_XDECREF(given);
  return dict;
}

static PyObject *model_set_going(PyObject *object, PyObject *args, PyObject *keywords) {
  const bd_core_model *self = (bd_core_model *)object;
  PyObject *mapping;
  double speed;
  const bd_argument rows[] = {{"state", BD_OBJECT, &mapping}, {"speed", BD_REAL, &speed}, {0}};
  if (bd_convert_arguments(args, keywords, "set_going", 2, 2, rows) < 0) {
    return NULL;
  }
  bd_state state, going;
  bd_error err = {0};
  PyObject *given = bd_core_state_read(&state, mapping, &self->info);
  PyObject *result = given ? bd_core_state_new(&going, &self->info) : NULL;
  if (result) {
    const int code = bd_model_set_going(self->model, &state, speed, &going, &err);
    result = bd_core_state_timed(bd_core_result(result, code, &err), &going);
  }
  Py_XDECREF(given);
  return result;
}

static PyObject *model_solve(PyObject *object, PyObject *args, PyObject *keywords) {
  const bd_core_model *self = (bd_core_model *)object;
  PyObject *mapping, *vector;
  double g;
  const bd_argument rows[] = {
      {"state", BD_OBJECT, &mapping}, {"g", BD_REAL, &g}, {"c", BD_OBJECT, &vector}, {0}};
  if (bd_convert_arguments(args, keywords, "solve", 3, 3, rows) < 0) {
    return NULL;
  }
  bd_state state, c, k;
  bd_error err = {0};
  PyObject *given = bd_core_state_read(&state, mapping, &self->info);
  PyObject *right = given ? bd_core_state_read(&c, vector, &self->info) : NULL;
  PyObject *result = right ? bd_core_state_new(&k, &self->info) : NULL;
  if (result) {
    result = bd_core_result(result, bd_model_solve(self->model, &state, g, &c, &k, &err), &err);
  }
  Py_XDECREF(right);
  Py_XDECREF(given);
  return result;
}

static PyObject *copied(int type, const void *from, size_t n) {
  const npy_intp length = (npy_intp)n;
  PyObject *array = PyArray_SimpleNew(1, &length, type);
  if (array && n > 0) {
    memcpy(PyArray_DATA((PyArrayObject *)array), from,
           n * (size_t)PyArray_ITEMSIZE((PyArrayObject *)array));
  }
  return array;
}

static PyObject *model_jacobian(PyObject *object, PyObject *mapping) {
  const bd_core_model *self = (bd_core_model *)object;
  PyObject *result = NULL;
  bd_state state;
  PyObject *given = bd_core_state_read(&state, mapping, &self->info);
  if (given) {
    bd_error err = {0};
    bd_jacobian *j = NULL;
    const int code = bd_model_jacobian(self->model, &state, &j, &err);
    result = code < 0 ? bd_core_raise(code, &err)
                      : Py_BuildValue("(NNN)", copied(NPY_INT64, j->rows, j->n),
                                      copied(NPY_INT64, j->columns, j->n),
                                      copied(NPY_DOUBLE, j->values, j->n));
    bd_jacobian_free(j);
    Py_DECREF(given);
  }
  return result;
}

/* --- what a model knows of itself ------------------------------------------------------------- */

static PyObject *model_belt(PyObject *object, void *Py_UNUSED(closure)) {
  const int row = bd_model_belt(((bd_core_model *)object)->model);
  return PyUnicode_FromString(bd_belt_facts_at(row)->name);
}

static PyObject *model_info(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_model *self = (const bd_core_model *)object;
  PyObject *dict = PyDict_New();
#define X(type, name, text) BD_CORE_SET_VALUE(dict, self->info, name)
  BD_INFO(X)
#undef X
  return dict;
}

static PyObject *model_friction(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_model *self = (const bd_core_model *)object;
  PyObject *all = PyList_New(0);
  for (int j = 0; j < self->info.n_pulleys; j++) {
    double kinetic, slip;
    const int law = bd_model_friction(self->model, j, &kinetic, &slip);
    all = bd_core_append(all, Py_BuildValue("(sdd)", bd_law_name(law), kinetic, slip));
  }
  return bd_core_tuple(all);
}

static PyObject *model_sizes(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_model *self = (const bd_core_model *)object;
  PyObject *dict = PyDict_New();
  for (int k = 0; dict && k < BD_N_SIZES; k++) {
    int columns[BD_N_ENERGY];
    const size_t size = k == BD_SIZE_ENERGY ? (size_t)bd_model_energy_terms(self->model, columns)
                                            : bd_size(&self->info, k);
    if (bd_core_set(dict, bd_size_name(k), PyLong_FromSize_t(size)) < 0) {
      Py_CLEAR(dict);
    }
  }
  return dict;
}

static PyObject *model_energy_terms(PyObject *object, void *Py_UNUSED(closure)) {
  static const char *const names[] = {
#define X(name, kind, text) #name,
      BD_ENERGY_TERMS(X)
#undef X
  };
  const bd_core_model *self = (const bd_core_model *)object;
  int terms[BD_N_ENERGY], n = bd_model_energy_terms(self->model, terms);
  PyObject *all = PyList_New(0);
  for (int k = 0; k < n; k++) {
    all = bd_core_append(all, PyUnicode_FromString(names[terms[k]]));
  }
  return bd_core_tuple(all);
}

static PyObject *model_mount_forces(PyObject *object, PyObject *travel) {
  bd_core_model *self = (bd_core_model *)object;
  const npy_intp mounts = self->info.n_mounts;
  PyArrayObject *given = bd_convert_array(travel, "travel", 1, &mounts);
  PyArrayObject *force = given ? (PyArrayObject *)PyArray_SimpleNew(1, &mounts, NPY_DOUBLE) : NULL;
  if (force) {
    bd_model_mount_forces(self->model, PyArray_DATA(given), PyArray_DATA(force));
  }
  Py_XDECREF(given);
  return (PyObject *)force;
}

static PyObject *model_centers(PyObject *object, PyObject *travel) {
  bd_core_model *self = (bd_core_model *)object;
  const npy_intp mounts = self->info.n_mounts, shape[2] = {self->info.n_pulleys, 2};
  PyArrayObject *given = bd_convert_array(travel, "travel", 1, &mounts);
  PyArrayObject *centers = given ? (PyArrayObject *)PyArray_SimpleNew(2, shape, NPY_DOUBLE) : NULL;
  if (centers) {
    bd_model_centers(self->model, PyArray_DATA(given), PyArray_DATA(centers));
  }
  Py_XDECREF(given);
  return (PyObject *)centers;
}

/* Arrays of one shape, element by element. */
static PyObject *model_depth(PyObject *object, PyObject *args) {
  static const char *const names[] = {"radius", "tension", "speed"};
  const bd_model *model = ((bd_core_model *)object)->model;
  PyObject *given[3];
  PyArrayObject *at[3] = {NULL}, *depth = NULL;
  if (!PyArg_ParseTuple(args, "OOO:depth", &given[0], &given[1], &given[2])) {
    return NULL;
  }
  for (int k = 0; k < 3 && (k == 0 || at[k - 1]); ++k) {
    at[k] = k == 0 ? bd_convert_array(given[k], names[k], BD_ANY, NULL)
                   : bd_convert_array(given[k], names[k], PyArray_NDIM(at[0]), PyArray_DIMS(at[0]));
  }
  if (at[2]) {
    depth =
        (PyArrayObject *)PyArray_SimpleNew(PyArray_NDIM(at[0]), PyArray_DIMS(at[0]), NPY_DOUBLE);
  }
  for (npy_intp n = 0; depth && n < PyArray_SIZE(depth); ++n) {
    const double *radius = PyArray_DATA(at[0]), *tension = PyArray_DATA(at[1]),
                 *speed = PyArray_DATA(at[2]);
    if (!(radius[n] > 0.0)) {
      PyErr_SetString(PyExc_ValueError, "radius must be > 0 m");
      Py_CLEAR(depth);
      break;
    }
    ((double *)PyArray_DATA(depth))[n] = bd_model_depth(model, radius[n], tension[n], speed[n]);
  }
  for (int k = 0; k < 3; ++k) {
    Py_XDECREF(at[k]);
  }
  return (PyObject *)depth;
}

static PyMethodDef model_methods[] = {
    {"check_geometry", model_check_geometry, METH_NOARGS,
     "check_geometry($self, /)\n--\n\nCheck that the belt can run on the pulleys."},
    {"centers", model_centers, METH_O,
     "centers($self, travel, /)\n--\n\n"
     "Axes of all pulleys (n_p, 2) [m] at travels of the mounts (n_m,)."},
    {"mount_forces", model_mount_forces, METH_O,
     "mount_forces($self, travel, /)\n--\n\n"
     "Springs, hung weights and stops on mounts that stand at these travels (n_m,)."},
    {"depth", model_depth, METH_VARARGS,
     "depth($self, radius, tension, speed, /)\n--\n\n"
     "Depth to which the belt sinks into pulleys [m], element by element."},
    BD_CORE_KEYWORDS(
        "solve", model_solve,
        "solve($self, /, state, g, c)\n--\n\n"
        "k of (1 - g J) k = g c, J the Jacobian of rate() at a state, torques constant."),
    {"jacobian", model_jacobian, METH_O,
     "jacobian($self, state, /)\n--\n\n"
     "Entries of the Jacobian of rate() at a state: rows, columns, values."},
    BD_CORE_KEYWORDS("set_going", model_set_going,
                     "set_going($self, /, state, speed)\n--\n\n"
                     "A state with its belt running along itself and all pulleys turning with it."),
    BD_CORE_KEYWORDS("torques", model_torques,
                     "torques($self, /, torque, motion, t, until, theta, omega)\n--\n\n"
                     "Set torques (n_p,) and speeds (n_p,) at a time, those of motions in them."),
    {"observe", model_observe, METH_O,
     "observe($self, state, /)\n--\n\n"
     "What a run would sample at a state, without torques."},
    BD_CORE_KEYWORDS(
        "rate", model_rate,
        "rate($self, /, state, torque)\n--\n\nTime derivative of a state under the model."),
    {NULL, NULL, 0, NULL},
};

static PyObject *model_rest(PyObject *object, void *Py_UNUSED(closure)) {
  bd_core_model *self = (bd_core_model *)object;
  const npy_intp mounts = self->info.n_mounts;
  PyArrayObject *travel = (PyArrayObject *)PyArray_SimpleNew(1, &mounts, NPY_DOUBLE);
  if (travel) {
    bd_model_rest(self->model, PyArray_DATA(travel));
  }
  return (PyObject *)travel;
}

/* The pulley of each cell, or with a closure its share of the wrap. */
static PyObject *model_cells(PyObject *object, void *closure) {
  bd_core_model *self = (bd_core_model *)object;
  const npy_intp cells = self->info.n_bodies;
  PyArrayObject *pulley = (PyArrayObject *)PyArray_SimpleNew(1, &cells, NPY_INT32);
  PyArrayObject *share = pulley ? (PyArrayObject *)PyArray_SimpleNew(1, &cells, NPY_DOUBLE) : NULL;
  PyObject *found = NULL;
  if (share && bd_model_cells(self->model, PyArray_DATA(pulley), PyArray_DATA(share))) {
    found = (PyObject *)(closure ? share : pulley);
  } else if (share) {
    found = Py_None;
  }
  Py_XINCREF(found);
  Py_XDECREF(pulley);
  Py_XDECREF(share);
  return found;
}

#define X(name, text) BD_CORE_SET_VALUE(dict, numbers, name)
#define NUMBERS_OF(part, TABLE)                                                                    \
  static PyObject *model_##part##s(PyObject *object, void *Py_UNUSED(closure)) {                   \
    const bd_core_model *self = (const bd_core_model *)object;                                     \
    PyObject *all = PyList_New(0);                                                                 \
    for (int k = 0; k < self->info.n_##part##s; k++) {                                             \
      const bd_##part##_numbers numbers = bd_model_##part(self->model, k);                         \
      PyObject *dict = PyDict_New();                                                               \
      TABLE(X)                                                                                     \
      all = bd_core_append(all, dict);                                                             \
    }                                                                                              \
    return bd_core_tuple(all);                                                                     \
  }
NUMBERS_OF(mount, BD_MOUNT_NUMBERS)
NUMBERS_OF(coupling, BD_COUPLING_NUMBERS)
#undef NUMBERS_OF
#undef X

static PyGetSetDef model_properties[] = {
    {"info", model_info, NULL,
     "Numbers of the model and constants derived from it (struct bd_info), a new dict [SI].", NULL},
    {"belt", model_belt, NULL, "Name of its row in BELTS.", NULL},
    {"friction", model_friction, NULL,
     "Friction of each pulley: a tuple of (name of the law or \"none\", coefficient in full\n"
     "slip [1], slip in which friction develops at rest [m]).",
     NULL},
    {"rest", model_rest, NULL, "Travels of the mounts (n_m,) in equilibrium with the belt.", NULL},
    {"sizes", model_sizes, NULL,
     "How many values fields and outputs of each size have; of PLANE vectors.", NULL},
    {"cells", model_cells, NULL,
     "The pulley of each cell (n_bodies,), -1 in spans; None: it is a belt of nodes.", NULL},
    {"cell_shares", model_cells, NULL,
     "The share of the wrap that is behind where each cell begins (n_bodies,); or None.",
     (void *)"share"},
    {"mounts", model_mounts, NULL, "Numbers of each mount as they act, given or chosen, a dict.",
     NULL},
    {"couplings", model_couplings, NULL, "The same of each coupling.", NULL},
    {"energy_terms", model_energy_terms, NULL,
     "Columns of the output \"energy\" of its runs, rows of ENERGY_TERMS by name.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

static PyType_Slot model_slots[] = {
    {Py_tp_doc,
     (void *)"Model(belt, centers, radii, inertias, contact, friction, gravity, drag=None,\n"
             "      pulley_friction=None, mesh='paper', outside=None, names=None, mounts=None,\n"
             "      model='links', couplings=None)\n--\n\n"
             "A checked, constant scene; may be shared by simulations in any thread."},
    {Py_tp_new, model_new},
    {Py_tp_traverse, model_traverse},
    {Py_tp_dealloc, model_dealloc},
    {Py_tp_methods, model_methods},
    {Py_tp_getset, model_properties},
    {0, NULL},
};

static PyType_Spec model_spec = {
    .name = "beltdyn._core.Model",
    .basicsize = sizeof(bd_core_model),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_IMMUTABLETYPE,
    .slots = model_slots,
};

int bd_core_add_model(PyObject *module, bd_core_module *state) {
  PyObject *type = PyType_FromModuleAndSpec(module, &model_spec, NULL);
  state->model_type = (PyTypeObject *)type; /* the reference is the module's */
  return type ? PyModule_AddType(module, state->model_type) : -1;
}
