/* SPDX-License-Identifier: MIT
 *
 * Model, the constant scene; and states going in and out as mappings of arrays. Guarded by
 * tests/test_module.py (arguments) and tests/test_lifetime.py (references).
 */
#include "binding/binding.h"

#include <limits.h>
#include <stddef.h>
#include <string.h>

/* --- states ---------------------------------------------------------------------------------- */

enum { SIZE_LINKS, SIZE_SLOTS, SIZE_PULLEYS };

/* The name, length kind and pointer of every state field, in the order of BD_STATE_FIELDS. */
static const struct {
  const char *name;
  int size;
  size_t offset;
} state_fields[] = {
#define X(symbol, name, size, scale, unit, text) {#name, SIZE_##size, offsetof(bd_state, name)},
    BD_STATE_FIELDS(X)
#undef X
};

static npy_intp length_of(int size, const bd_info *info) {
  return size == SIZE_LINKS   ? info->n_bodies
         : size == SIZE_SLOTS ? (npy_intp)info->n_slots * info->n_bodies
                              : info->n_pulleys;
}

/* Hands an array (NULL: failed already) to the record, which then owns it. */
static int put_array(bd_core_state *out, int k, PyArrayObject *array) {
  if (!array) {
    return -1;
  }
  double *data = PyArray_DATA(array);
  out->arrays[k] = array;
  memcpy((char *)&out->state + state_fields[k].offset, &data, sizeof data);
  return 0;
}

/* A new reference to state[name]; what a plain dict lacks is a ValueError, not a KeyError. */
static PyObject *get_field(PyObject *mapping, const char *name) {
  PyObject *value = PyMapping_GetItemString(mapping, name);
  if (!value && PyErr_ExceptionMatches(PyExc_KeyError)) {
    PyErr_Format(PyExc_ValueError, "state lacks '%s'", name);
  }
  return value;
}

int bd_core_state_read(bd_core_state *out, PyObject *mapping, const bd_info *info) {
  *out = (bd_core_state){0};
  /* The containers of the language that are indexed by number pass PyMapping_Check too. */
  if (!PyMapping_Check(mapping) || PyList_Check(mapping) || PyTuple_Check(mapping) ||
      PyUnicode_Check(mapping) || PyBytes_Check(mapping) || PyArray_Check(mapping)) {
    PyErr_Format(PyExc_TypeError, "state must be a mapping of arrays by name, got %.100s",
                 Py_TYPE(mapping)->tp_name);
    return -1;
  }
  PyObject *value = get_field(mapping, "t");
  int failed = value ? bd_convert_finite(value, "state 't'", &out->state.t) : -1;
  Py_XDECREF(value);
  for (int k = 0; !failed && k < BD_CORE_N_STATE; k++) {
    char name[BD_NAME_SIZE];
    npy_intp length = length_of(state_fields[k].size, info);
    PyOS_snprintf(name, sizeof name, "state '%s'", state_fields[k].name);
    value = get_field(mapping, state_fields[k].name);
    failed = value ? put_array(out, k, bd_convert_array(value, name, 1, &length)) : -1;
    Py_XDECREF(value);
  }
  if (failed) {
    bd_core_state_release(out);
  }
  return failed;
}

int bd_core_state_new(bd_core_state *out, const bd_info *info) {
  *out = (bd_core_state){0};
  for (int k = 0; k < BD_CORE_N_STATE; k++) {
    npy_intp length = length_of(state_fields[k].size, info);
    if (put_array(out, k, (PyArrayObject *)PyArray_ZEROS(1, &length, NPY_DOUBLE, 0)) < 0) {
      bd_core_state_release(out);
      return -1;
    }
  }
  return 0;
}

PyObject *bd_core_state_dict(const bd_core_state *state, int with_time) {
  PyObject *dict = PyDict_New();
  if (!dict) {
    return NULL;
  }
  if (with_time && bd_core_set(dict, "t", PyFloat_FromDouble(state->state.t)) < 0) {
    goto fail;
  }
  for (int k = 0; k < BD_CORE_N_STATE; k++) {
    if (PyDict_SetItemString(dict, state_fields[k].name, (PyObject *)state->arrays[k]) < 0) {
      goto fail;
    }
  }
  return dict;
fail:
  Py_DECREF(dict);
  return NULL;
}

void bd_core_state_release(bd_core_state *state) {
  for (int k = 0; k < BD_CORE_N_STATE; k++) {
    Py_CLEAR(state->arrays[k]);
  }
}

/* --- arguments of Model ---------------------------------------------------------------------- */

/* The core checks the rule itself. */
static int read_parameter(PyObject *value, const char *label, const bd_parameter *row,
                          char *record) {
  char name[BD_NAME_SIZE];
  PyOS_snprintf(name, sizeof name, "%s.%s", label, row->name);
  if (!row->is_integer) {
    double number;
    if (bd_convert_real(value, name, &number) < 0) {
      return -1;
    }
    memcpy(record + row->offset, &number, sizeof number);
    return 0;
  }
  long count;
  if (bd_convert_long(value, name, &count) < 0) {
    return -1;
  }
  if (count < INT_MIN || count > INT_MAX) {
    PyErr_Format(PyExc_ValueError, "%s is too large: %ld", name, count);
    return -1;
  }
  int integer = (int)count;
  memcpy(record + row->offset, &integer, sizeof integer);
  return 0;
}

/* A tuple of the parameters of one group, in their order, into its C struct; called `label` in
 * messages, as the core calls it. */
static int read_group(PyObject *object, const char *group, const char *label, void *record) {
  Py_ssize_t count = 0;
  for (size_t k = 0; k < bd_n_parameters; k++) {
    count += !strcmp(bd_parameters[k].group, group);
  }
  if (!PyTuple_Check(object)) {
    PyErr_Format(PyExc_TypeError, "%s must be a tuple of %zd numbers, got %.100s", label, count,
                 Py_TYPE(object)->tp_name);
    return -1;
  }
  if (PyTuple_GET_SIZE(object) != count) {
    PyErr_Format(PyExc_ValueError, "%s must have %zd numbers, got %zd", label, count,
                 PyTuple_GET_SIZE(object));
    return -1;
  }
  Py_ssize_t at = 0;
  for (size_t k = 0; k < bd_n_parameters; k++) {
    if (!strcmp(bd_parameters[k].group, group) &&
        read_parameter(PyTuple_GET_ITEM(object, at++), label, &bd_parameters[k], record) < 0) {
      return -1;
    }
  }
  return 0;
}

static int read_gravity(PyObject *object, double gravity[2]) {
  const npy_intp two = 2;
  PyArrayObject *array = bd_convert_array(object, "gravity", 1, &two);
  if (!array) {
    return -1;
  }
  memcpy(gravity, PyArray_DATA(array), 2 * sizeof *gravity);
  Py_DECREF(array);
  return 0;
}

int bd_core_read_friction(PyObject *object, const char *label, bd_friction *friction) {
  if (object == Py_None) {
    return 0;
  }
  const char *name = PyTuple_Check(object) && PyTuple_GET_SIZE(object) == 2 &&
                             PyUnicode_Check(PyTuple_GET_ITEM(object, 0))
                         ? PyUnicode_AsUTF8(PyTuple_GET_ITEM(object, 0))
                         : NULL;
  if (!name) {
    if (!PyErr_Occurred()) {
      PyErr_Format(PyExc_TypeError, "%s must be a tuple (name of the law, its numbers), got %R",
                   label, object);
    }
    return -1;
  }
  friction->law = bd_law_find(name);
  if (friction->law < 0) {
    PyErr_Format(PyExc_ValueError, "%s: there is no friction law '%s'", label, name);
    return -1;
  }
  return read_group(PyTuple_GET_ITEM(object, 1), name, label, &friction->dahl);
}

/* What one pulley has of an argument that has an entry for each of them. */
typedef int (*read_entry)(PyObject *entry, const char *label, bd_pulley *pulley,
                          bd_friction *friction);

static int read_drag(PyObject *entry, const char *label, bd_pulley *pulley, bd_friction *friction) {
  (void)friction;
  return read_group(entry, "drag", label, &pulley->drag);
}

static int read_own_friction(PyObject *entry, const char *label, bd_pulley *pulley,
                             bd_friction *friction) {
  pulley->friction = friction;
  return bd_core_read_friction(entry, label, friction);
}

static int read_outside(PyObject *entry, const char *label, bd_pulley *pulley,
                        bd_friction *friction) {
  (void)friction;
  return bd_convert_bool(entry, label, &pulley->outside);
}

/* One entry, or None, for each pulley; None: no pulley has any. */
static int read_entries(PyObject *object, const char *name, read_entry read, npy_intp count,
                        bd_pulley *pulleys, bd_friction *frictions) {
  if (object == Py_None) {
    return 0;
  }
  PyObject *rows = PySequence_Check(object) && !PyUnicode_Check(object)
                       ? PySequence_Fast(object, "must be a sequence")
                       : NULL;
  if (!rows) {
    if (!PyErr_Occurred()) {
      PyErr_Format(PyExc_TypeError, "%s must be a sequence of tuples, got %.100s", name,
                   Py_TYPE(object)->tp_name);
    }
    return -1;
  }
  int failed = 0;
  if (PySequence_Fast_GET_SIZE(rows) != count) {
    PyErr_Format(PyExc_ValueError, "%s must have one entry for each of %zd pulleys, got %zd", name,
                 (Py_ssize_t)count, PySequence_Fast_GET_SIZE(rows));
    failed = -1;
  }
  for (Py_ssize_t j = 0; !failed && j < count; j++) {
    PyObject *row = PySequence_Fast_GET_ITEM(rows, j);
    char label[BD_NAME_SIZE];
    PyOS_snprintf(label, sizeof label, "pulleys[%d].%s", (int)j, name);
    failed = row == Py_None ? 0 : read(row, label, &pulleys[j], &frictions[j]);
  }
  Py_DECREF(rows);
  return failed;
}

/* The pulleys as a fresh block (PyMem_Free it), after them the friction laws that they point to;
 * their number in *n. */
static bd_pulley *read_pulleys(PyObject *centers, PyObject *radii, PyObject *inertias,
                               PyObject *drag, PyObject *friction, PyObject *outside, int *n) {
  const npy_intp pairs[2] = {BD_ANY, 2};
  bd_pulley *pulleys = NULL;
  PyArrayObject *center = bd_convert_array(centers, "centers", 2, pairs), *radius = NULL,
                *inertia = NULL;
  if (!center) {
    return NULL;
  }
  npy_intp count = PyArray_DIM(center, 0);
  if (count > INT_MAX) {
    PyErr_SetString(PyExc_ValueError, "centers has too many rows");
    goto out;
  }
  radius = bd_convert_array(radii, "radii", 1, &count);
  if (!radius) {
    goto out;
  }
  inertia = bd_convert_array(inertias, "inertias", 1, &count);
  if (!inertia) {
    goto out;
  }
  pulleys = PyMem_Calloc((size_t)count, sizeof *pulleys + sizeof(bd_friction));
  if (!pulleys) {
    PyErr_NoMemory();
    goto out;
  }
  const double *c = PyArray_DATA(center), *r = PyArray_DATA(radius), *i = PyArray_DATA(inertia);
  for (npy_intp j = 0; j < count; j++) {
    pulleys[j] = (bd_pulley){
        .center = {c[2 * j], c[2 * j + 1]},
        .radius = r[j],
        .inertia = i[j],
    };
  }
  bd_friction *frictions = (bd_friction *)(pulleys + count);
  if (read_entries(drag, "drag", read_drag, count, pulleys, frictions) < 0 ||
      read_entries(friction, "friction", read_own_friction, count, pulleys, frictions) < 0 ||
      read_entries(outside, "outside", read_outside, count, pulleys, frictions) < 0) {
    PyMem_Free(pulleys);
    pulleys = NULL;
  }
  *n = (int)count;
out:
  Py_DECREF(center);
  Py_XDECREF(radius);
  Py_XDECREF(inertia);
  return pulleys;
}

/* --- belt line ------------------------------------------------------------------------------- */

PyObject *bd_core_belt_line(PyObject *Py_UNUSED(module), PyObject *args, PyObject *keywords) {
  char *names[] = {"centers", "radii", "outside", NULL};
  PyObject *centers, *radii, *outside = Py_None;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "OO|O:belt_line", names, &centers, &radii,
                                   &outside)) {
    return NULL;
  }
  int n = 0, turns = 0;
  double length = 0.0;
  bd_pulley *pulleys = read_pulleys(centers, radii, radii, Py_None, Py_None, outside, &n);
  if (!pulleys) {
    return NULL;
  }
  PyObject *rows = NULL;
  bd_error err = {0};
  bd_wrap *wraps = PyMem_Calloc((size_t)n + 1, sizeof *wraps);
  if (!wraps) {
    PyErr_NoMemory();
  } else if (n == 0) {
    PyErr_SetString(PyExc_ValueError, "centers must have at least one row");
  } else if (bd_belt_line(n, pulleys, wraps, &length, &turns, &err) < 0) {
    bd_core_raise(err.code, &err);
  } else {
    rows = PyTuple_New(n);
  }
  for (int j = 0; rows && j < n; j++) {
    const bd_wrap *wrap = &wraps[j];
    PyObject *row = Py_BuildValue("(dddi)", wrap->arrive, wrap->wrap, wrap->span, wrap->sense);
    if (row) {
      PyTuple_SET_ITEM(rows, j, row);
    } else {
      Py_CLEAR(rows);
    }
  }
  PyMem_Free(wraps);
  PyMem_Free(pulleys);
  return rows ? Py_BuildValue("(Ndi)", rows, length, turns) : NULL;
}

/* --- Model ----------------------------------------------------------------------------------- */

/* All in tp_new, the object last: one that exists is a whole one. */
static PyObject *model_new(PyTypeObject *type, PyObject *args, PyObject *keywords) {
  char *names[] = {"belt",    "centers", "radii",           "inertias", "contact", "friction",
                   "gravity", "drag",    "pulley_friction", "mesh",     "outside", NULL};
  PyObject *belt, *centers, *radii, *inertias, *contact, *default_friction, *gravity;
  PyObject *drag = Py_None, *pulley_friction = Py_None, *outside = Py_None;
  const char *mesh = "paper";
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "OOOOOOO|OOsO:Model", names, &belt, &centers,
                                   &radii, &inertias, &contact, &default_friction, &gravity, &drag,
                                   &pulley_friction, &mesh, &outside)) {
    return NULL;
  }
  bd_scene scene = {0};
  bd_friction friction = {0};
  if (read_group(belt, "belt", "belt", &scene.belt) < 0 ||
      read_group(contact, "contact", "contact", &scene.contact) < 0 ||
      bd_core_read_friction(default_friction, "friction", &friction) < 0 ||
      read_gravity(gravity, scene.gravity) < 0) {
    return NULL;
  }
  bd_pulley *pulleys =
      read_pulleys(centers, radii, inertias, drag, pulley_friction, outside, &scene.n_pulleys);
  if (!pulleys) {
    return NULL;
  }
  scene.pulleys = pulleys;
  const int is_joint = strcmp(mesh, "joint") == 0;
  if (!is_joint && strcmp(mesh, "paper") != 0) {
    PyErr_Format(PyExc_ValueError, "belt.mesh must be \"joint\" or \"paper\", got \"%.100s\"",
                 mesh);
    PyMem_Free(pulleys);
    return NULL;
  }
  scene.belt.mesh = is_joint ? BD_MESH_JOINT : BD_MESH_PAPER;
  scene.friction = default_friction == Py_None ? NULL : &friction;

  bd_error err = {0};
  bd_model *model = NULL;
  int code = bd_model_create(&model, &scene, &err);
  PyMem_Free(pulleys);
  if (code < 0) {
    return bd_core_raise(code, &err);
  }
  bd_core_model *self = (bd_core_model *)type->tp_alloc(type, 0);
  if (!self) {
    bd_model_free(model);
    return NULL;
  }
  self->model = model;
  bd_model_info(model, &self->info);
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

PyDoc_STRVAR(check_geometry_doc,
             "check_geometry($self, /)\n--\n\n"
             "Check that the belt can run on the pulleys.\n\n"
             "Raises ValueError if pulleys overlap, one is not reached, or the belt is too long\n"
             "(slack) or too short (strain above MAX_STRAIN).");

static PyObject *model_check_geometry(PyObject *self, PyObject *Py_UNUSED(none)) {
  bd_error err = {0};
  int code = bd_model_check_geometry(((bd_core_model *)self)->model, &err);
  if (code < 0) {
    return bd_core_raise(code, &err);
  }
  Py_RETURN_NONE;
}

PyDoc_STRVAR(rate_doc, "rate($self, /, state, torque)\n--\n\n"
                       "Time derivative of a state under the model.\n\n"
                       "state: mapping of STATE_FIELDS by name and \"t\". torque: one value per\n"
                       "pulley [N m], shape (n_p,). Returns a dict of STATE_FIELDS by name: the\n"
                       "derivatives [.../s], shapes as in state. Raises TypeError or ValueError\n"
                       "naming the argument, and SimulationError if there is no finite result.");

static PyObject *model_rate(PyObject *object, PyObject *args, PyObject *keywords) {
  char *names[] = {"state", "torque", NULL};
  PyObject *mapping, *torque, *result = NULL;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "OO:rate", names, &mapping, &torque)) {
    return NULL;
  }
  bd_core_model *self = (bd_core_model *)object;
  const npy_intp n_pulleys = self->info.n_pulleys;
  bd_core_state state, rate = {0};
  if (bd_core_state_read(&state, mapping, &self->info) < 0) {
    return NULL;
  }
  PyArrayObject *values = bd_convert_array(torque, "torque", 1, &n_pulleys);
  if (values && !bd_core_state_new(&rate, &self->info)) {
    bd_error err = {0};
    int code = bd_model_rate(self->model, &state.state, PyArray_DATA(values), &rate.state, &err);
    result = code < 0 ? bd_core_raise(code, &err) : bd_core_state_dict(&rate, 0);
  }
  Py_XDECREF(values);
  bd_core_state_release(&state);
  bd_core_state_release(&rate);
  return result;
}

static PyObject *model_info(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_info *info = &((bd_core_model *)object)->info;
  PyObject *dict = PyDict_New();
  if (!dict) {
    return NULL;
  }
#define X(type, name, text)                                                                        \
  if (bd_core_set(dict, #name, BD_CORE_NUMBER(info->name)) < 0)                                    \
    goto fail;
  BD_INFO(X)
#undef X
  return dict;
fail:
  Py_DECREF(dict);
  return NULL;
}

PyDoc_STRVAR(
    solve_doc,
    "solve($self, /, state, g, c)\n--\n\n"
    "k of (1 - g J) k = g c, J the Jacobian of rate() at a state, torques constant.\n\n"
    "state: mapping of STATE_FIELDS by name and \"t\". g: > 0 [s]. c: laid out as the\n"
    "state. Returns a dict of STATE_FIELDS by name. Contact and friction are taken on the\n"
    "side of their kinks on which the state stands. Raises TypeError or ValueError naming\n"
    "the argument.");

static PyObject *model_solve(PyObject *object, PyObject *args, PyObject *keywords) {
  char *names[] = {"state", "g", "c", NULL};
  PyObject *mapping, *step, *vector, *result = NULL;
  double g;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "OOO:solve", names, &mapping, &step, &vector) ||
      bd_convert_real(step, "g", &g) < 0) {
    return NULL;
  }
  bd_core_model *self = (bd_core_model *)object;
  bd_core_state state = {0}, c = {0}, k = {0};
  if (!bd_core_state_read(&state, mapping, &self->info) &&
      !bd_core_state_read(&c, vector, &self->info) && !bd_core_state_new(&k, &self->info)) {
    bd_error err = {0};
    int code = bd_model_solve(self->model, &state.state, g, &c.state, &k.state, &err);
    result = code < 0 ? bd_core_raise(code, &err) : bd_core_state_dict(&k, 0);
  }
  bd_core_state_release(&state);
  bd_core_state_release(&c);
  bd_core_state_release(&k);
  return result;
}

PyDoc_STRVAR(
    friction_doc,
    "Friction of each pulley: a tuple of (name of the law or \"none\", coefficient in full\n"
    "slip [1], slip in which friction develops at rest [m]).");

static PyObject *model_friction(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_model *self = (const bd_core_model *)object;
  PyObject *all = PyTuple_New(self->info.n_pulleys);
  for (int j = 0; all && j < self->info.n_pulleys; j++) {
    double kinetic, slip;
    const int law = bd_model_friction(self->model, j, &kinetic, &slip);
    PyObject *row = Py_BuildValue("(sdd)", bd_law_name(law), kinetic, slip);
    if (row) {
      PyTuple_SET_ITEM(all, j, row);
    } else {
      Py_CLEAR(all);
    }
  }
  return all;
}

static PyObject *model_energy_terms(PyObject *object, void *Py_UNUSED(closure)) {
  static const char *const names[] = {
#define X(name, kind, text) #name,
      BD_ENERGY_TERMS(X)
#undef X
  };
  const bd_core_model *self = (const bd_core_model *)object;
  int terms[BD_N_ENERGY], n = bd_model_energy_terms(self->model, terms);
  PyObject *all = PyTuple_New(n);
  for (int k = 0; all && k < n; k++) {
    PyObject *name = PyUnicode_FromString(names[terms[k]]);
    if (name) {
      PyTuple_SET_ITEM(all, k, name);
    } else {
      Py_CLEAR(all);
    }
  }
  return all;
}

static PyMethodDef model_methods[] = {
    {"check_geometry", model_check_geometry, METH_NOARGS, check_geometry_doc},
    {"solve", (PyCFunction)(void (*)(void))model_solve, METH_VARARGS | METH_KEYWORDS, solve_doc},
    {"rate", (PyCFunction)(void (*)(void))model_rate, METH_VARARGS | METH_KEYWORDS, rate_doc},
    {NULL, NULL, 0, NULL},
};

static PyGetSetDef model_properties[] = {
    {"info", model_info, NULL,
     "Numbers of the model and constants derived from it (struct bd_info), a new dict [SI].", NULL},
    {"friction", model_friction, NULL, friction_doc, NULL},
    {"energy_terms", model_energy_terms, NULL,
     "Columns of the output \"energy\" of its runs, rows of ENERGY_TERMS by name.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

PyDoc_STRVAR(
    model_doc,
    "Model(belt, centers, radii, inertias, contact, friction, gravity, drag=None,\n"
    "      pulley_friction=None, mesh='paper', outside=None)\n--\n\n"
    "A checked, constant scene; may be shared by simulations in any thread.\n\n"
    "belt, contact: tuples of numbers as in PARAMETERS. friction: (name of a law in LAWS, tuple "
    "of\n"
    "its numbers), None: none. pulley_friction: that, or None, for each pulley that has its own.\n"
    "mesh: \"joint\" or \"paper\", MODEL section 3. outside: of each pulley, whether it is on the\n"
    "back of the belt; None: all inside the loop.\n"
    "centers: (n_p, 2) [m]. radii: (n_p,) [m]. inertias: (n_p,) [kg m^2].\n"
    "gravity: (2,) [m/s^2]. drag: a tuple as in PARAMETERS, or None, for each pulley; None: no\n"
    "drag. Raises TypeError or ValueError naming field and rule.");

static PyType_Slot model_slots[] = {
    {Py_tp_doc, (void *)model_doc},
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
