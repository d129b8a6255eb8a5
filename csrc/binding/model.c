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

static npy_intp length_of(int size, const bd_info *info) {
  return (npy_intp)bd_size(info, size);
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
  /* What the language and NumPy index by number passes PyMapping_Check too. */
  if (!PyMapping_Check(mapping) || PyList_Check(mapping) || PyTuple_Check(mapping) ||
      PyUnicode_Check(mapping) || PyBytes_Check(mapping) || PyArray_CheckAnyScalar(mapping) ||
      PyArray_Check(mapping)) {
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
    if (length == 0 && !PyMapping_HasKeyString(mapping, state_fields[k].name)) {
      failed = put_array(out, k, (PyArrayObject *)PyArray_ZEROS(1, &length, NPY_DOUBLE, 0));
      continue;
    }
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

/* --- Model ----------------------------------------------------------------------------------- */

const char *const bd_core_meshes[] = {[BD_MESH_PAPER] = "paper", [BD_MESH_JOINT] = "joint", NULL};
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
  char *arguments[] = {"belt",    "centers", "radii",           "inertias", "contact", "friction",
                       "gravity", "drag",    "pulley_friction", "mesh",     "outside", "names",
                       "mounts",  "model",   "couplings",       NULL};
  PyObject *belt, *centers, *radii, *inertias, *contact, *default_friction, *gravity;
  bd_core_pulley_parts parts = {Py_None, Py_None, Py_None, Py_None, Py_None, Py_None};
  const char *mesh = "paper", *belt_model = "links";
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "OOOOOOO|OOsOOOsO:Model", arguments, &belt,
                                   &centers, &radii, &inertias, &contact, &default_friction,
                                   &gravity, &parts.drag, &parts.friction, &mesh, &parts.outside,
                                   &parts.names, &parts.mounts, &belt_model, &parts.couplings)) {
    return NULL;
  }
  bd_scene scene = {0};
  bd_friction friction = {0};
  if (bd_core_read_group(belt, "belt", "belt", &scene.belt) < 0 ||
      bd_core_read_group(contact, "contact", "contact", &scene.contact) < 0 ||
      bd_core_read_friction(default_friction, "friction", &friction) < 0 ||
      bd_core_read_gravity(gravity, scene.gravity) < 0) {
    return NULL;
  }
  PyObject *keep = PyList_New(0);
  bd_pulley *pulleys =
      keep ? bd_core_read_pulleys(centers, radii, inertias, &parts, keep, &scene.n_pulleys) : NULL;
  if (!pulleys) {
    Py_XDECREF(keep);
    return NULL;
  }
  scene.pulleys = pulleys;
  if (read_choice("mesh", mesh, bd_core_meshes, "\"joint\" or \"paper\"", &scene.belt.mesh) < 0 ||
      read_choice("model", belt_model, bd_core_belt_models, "\"auto\", \"links\" or \"string\"",
                  &scene.belt.model) < 0) {
    PyMem_Free(pulleys);
    Py_DECREF(keep);
    return NULL;
  }
  scene.friction = default_friction == Py_None ? NULL : &friction;

  bd_error err = {0};
  bd_model *model = NULL;
  int code = bd_model_create(&model, &scene, &err);
  PyMem_Free(pulleys);
  Py_DECREF(keep);
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

PyDoc_STRVAR(observe_doc,
             "observe($self, /, state)\n--\n\n"
             "What a run would sample at a state, without torques.\n\n"
             "state: mapping of STATE_FIELDS by name and \"t\". Returns a dict of arrays of one\n"
             "row: OUTPUTS by name but energy, and \"pulley\". Raises TypeError or ValueError\n"
             "naming the argument.");

static PyObject *model_observe(PyObject *object, PyObject *mapping) {
  bd_core_model *self = (bd_core_model *)object;
  bd_core_state state;
  if (bd_core_state_read(&state, mapping, &self->info) < 0) {
    return NULL;
  }
  bd_output output = {0};
  PyObject *keep = PyList_New(0), *dict = PyDict_New();
  int done = keep && dict && bd_core_output_new(&output, keep, dict, &self->info, 0, 1, NULL) == 0;
  if (done) {
    bd_error err = {0};
    int code = bd_model_observe(self->model, &state.state, &output, &err);
    if (code < 0) {
      bd_core_raise(code, &err);
      done = 0;
    }
  }
  Py_XDECREF(keep);
  bd_core_state_release(&state);
  if (!done) {
    Py_CLEAR(dict);
  }
  return dict;
}

PyDoc_STRVAR(set_going_doc,
             "set_going($self, /, state, speed)\n--\n\n"
             "A state with its belt running along itself and all pulleys turning with it.\n\n"
             "state: mapping of STATE_FIELDS by name and \"t\". speed: of the belt in its spans,\n"
             "> 0 in the order of its links [m/s]. Returns a dict as of Simulation.state().\n"
             "Raises TypeError or ValueError naming the argument.");

static PyObject *model_set_going(PyObject *object, PyObject *args, PyObject *keywords) {
  char *names[] = {"state", "speed", NULL};
  PyObject *mapping, *given, *result = NULL;
  double speed;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "OO:set_going", names, &mapping, &given) ||
      bd_convert_real(given, "speed", &speed) < 0) {
    return NULL;
  }
  bd_core_model *self = (bd_core_model *)object;
  bd_core_state state = {0}, going = {0};
  if (!bd_core_state_read(&state, mapping, &self->info) &&
      !bd_core_state_new(&going, &self->info)) {
    bd_error err = {0};
    int code = bd_model_set_going(self->model, &state.state, speed, &going.state, &err);
    result = code < 0 ? bd_core_raise(code, &err) : bd_core_state_dict(&going, 1);
  }
  bd_core_state_release(&state);
  bd_core_state_release(&going);
  return result;
}

static PyObject *model_belt(PyObject *object, void *Py_UNUSED(closure)) {
  const int row = bd_model_belt(((bd_core_model *)object)->model);
  return PyUnicode_FromString(bd_belt_facts_at(row)->name);
}

static PyObject *model_info(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_model *self = (const bd_core_model *)object;
  PyObject *dict = PyDict_New();
#define X(type, name, text) BD_CORE_SET_NUMBER(dict, self->info, name)
  BD_INFO(X)
#undef X
  return dict;
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
    jacobian_doc,
    "jacobian($self, state, /)\n--\n\n"
    "Entries of J, the Jacobian of rate() at a state, torques constant: rows, columns, values.\n\n"
    "state: mapping of STATE_FIELDS by name and \"t\". Rows and columns count the numbers of\n"
    "all fields, one after the other in the order of STATE_FIELDS. Entries that are not 0,\n"
    "each once, in no order; phi and vphi of a string, which are no unknowns, have none.\n"
    "Contact and friction are taken on the side of their kinks on which the state stands.\n"
    "Raises TypeError or ValueError naming the argument, and SimulationError if it is not\n"
    "finite.");

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
  bd_core_model *self = (bd_core_model *)object;
  PyObject *result = NULL;
  bd_core_state state = {0};
  if (!bd_core_state_read(&state, mapping, &self->info)) {
    bd_error err = {0};
    bd_jacobian *j = NULL;
    const int code = bd_model_jacobian(self->model, &state.state, &j, &err);
    result = code < 0 ? bd_core_raise(code, &err)
                      : Py_BuildValue("(NNN)", copied(NPY_INT64, j->rows, j->n),
                                      copied(NPY_INT64, j->columns, j->n),
                                      copied(NPY_DOUBLE, j->values, j->n));
    bd_jacobian_free(j);
  }
  bd_core_state_release(&state);
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
    all = bd_core_put(all, j, Py_BuildValue("(sdd)", bd_law_name(law), kinetic, slip));
  }
  return all;
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
  PyObject *all = PyTuple_New(n);
  for (int k = 0; all && k < n; k++) {
    all = bd_core_put(all, k, PyUnicode_FromString(names[terms[k]]));
  }
  return all;
}

PyDoc_STRVAR(centers_doc, "centers($self, travel, /)\n--\n\n"
                          "Axes of all pulleys (n_p, 2) [m] at travels of the mounts (n_m,).");

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

static PyMethodDef model_methods[] = {
    {"check_geometry", model_check_geometry, METH_NOARGS, check_geometry_doc},
    {"centers", model_centers, METH_O, centers_doc},
    BD_CORE_KEYWORDS("solve", model_solve, solve_doc),
    {"jacobian", model_jacobian, METH_O, jacobian_doc},
    BD_CORE_KEYWORDS("set_going", model_set_going, set_going_doc),
    {"observe", model_observe, METH_O, observe_doc},
    BD_CORE_KEYWORDS("rate", model_rate, rate_doc),
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

static PyObject *model_mounts(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_model *self = (const bd_core_model *)object;
  PyObject *all = PyTuple_New(self->info.n_mounts);
  for (int m = 0; all && m < self->info.n_mounts; m++) {
    const bd_mount_numbers numbers = bd_model_mount(self->model, m);
    PyObject *dict = PyDict_New();
#define X(name, text) BD_CORE_SET_NUMBER(dict, numbers, name)
    BD_MOUNT_NUMBERS(X)
#undef X
    all = bd_core_put(all, m, dict);
  }
  return all;
}

static PyGetSetDef model_properties[] = {
    {"info", model_info, NULL,
     "Numbers of the model and constants derived from it (struct bd_info), a new dict [SI].", NULL},
    {"belt", model_belt, NULL, "Name of its row in BELTS.", NULL},
    {"friction", model_friction, NULL, friction_doc, NULL},
    {"rest", model_rest, NULL, "Travels of the mounts (n_m,) in equilibrium with the belt.", NULL},
    {"sizes", model_sizes, NULL,
     "How many values fields and outputs of each size have; of PLANE vectors.", NULL},
    {"mounts", model_mounts, NULL, "Numbers of each mount as they act, given or chosen, a dict.",
     NULL},
    {"energy_terms", model_energy_terms, NULL,
     "Columns of the output \"energy\" of its runs, rows of ENERGY_TERMS by name.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

PyDoc_STRVAR(
    model_doc,
    "Model(belt, centers, radii, inertias, contact, friction, gravity, drag=None,\n"
    "      pulley_friction=None, mesh='paper', outside=None, names=None, mounts=None,\n"
    "      model='links', couplings=None)\n--\n\n"
    "A checked, constant scene; may be shared by simulations in any thread.\n\n"
    "belt, contact: tuples of numbers as in PARAMETERS. friction: (name of a law in LAWS, tuple "
    "of\n"
    "its numbers), None: none. pulley_friction: that, or None, for each pulley that has its own.\n"
    "mesh: \"joint\" or \"paper\", MODEL section 3. outside: of each pulley, whether it is on the\n"
    "back of the belt; None: all inside the loop. mounts: (\"arm\", pivot, tuple as in\n"
    "PARAMETERS), (\"slider\", direction, tuple), (\"path\", t, displacement) or None, for each.\n"
    "couplings: (\"isolator\", \"clutch\" or \"damper\", tuple as in PARAMETERS) or None, for "
    "each.\n"
    "names: a name or None for each, for messages. model: \"links\", \"string\" or \"auto\",\n"
    "MODEL section 2.\n"
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
