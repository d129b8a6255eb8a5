/* SPDX-License-Identifier: MIT
 *
 * From Python objects to C values: one converter per kind of argument. Each checks everything that
 * can be wrong (kind, shape, finiteness) and says it with the argument's name.
 *
 * This header is also the one place that includes Python and NumPy; only files of
 * this folder see it. Guarded by tests/test_module.py.
 */
#ifndef BELTDYN_CONVERT_H
#define BELTDYN_CONVERT_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#ifndef NPY_NO_DEPRECATED_API
#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#endif
#define PY_ARRAY_UNIQUE_SYMBOL bd_core_numpy
#ifndef BD_CORE_IMPORTS_NUMPY /* module.c alone brings NumPy's table of functions */
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#include <stdint.h>

#define BD_ANY (-1) /* for a dimension or a number of dimensions: any */
#define BD_NAME_SIZE 80

/* All return 0, or -1 with an exception that names the argument. */

/* A TypeError: it must be what the rule says, and its type is another. */
int bd_convert_refuse(PyObject *object, const char *name, const char *rule);

/* A real number: float, int, a NumPy scalar, anything with __float__; no bool, str, complex and
 * nothing masked. */
int bd_convert_real(PyObject *object, const char *name, double *out);
/* The same and finite. */
int bd_convert_finite(PyObject *object, const char *name, double *out);
/* An integer: int or anything with __index__; no bool, no float. */
int bd_convert_long(PyObject *object, const char *name, long *out);
/* True or False (or NumPy's), not merely something that has a truth value. */
int bd_convert_bool(PyObject *object, const char *name, int *out);
/* An address held in a non-negative int. */
int bd_convert_address(PyObject *object, const char *name, uintptr_t *out);
/* A str without null characters, as UTF-8 that lives as long as the object. */
int bd_convert_text(PyObject *object, const char *name, const char **out);
/* So many numbers of an array (n,), finite. */
int bd_convert_numbers(PyObject *object, const char *name, npy_intp n, double *out);

/* An argument of a call: what it is converted by, and where it goes if it is given. */
enum { BD_OBJECT, BD_REAL, BD_FINITE, BD_LONG, BD_BOOL, BD_STR };
typedef struct bd_argument {
  const char *name;
  int kind;
  void *to; /* PyObject *, double, double, long, int, const char * */
} bd_argument;

enum { BD_MAX_ARGUMENTS = 15 };
/* The first so many arguments are required, the first so many may be given without their name; the
 * last row is {0}. `function` is what errors call it. */
int bd_convert_arguments(PyObject *args, PyObject *keywords, const char *function, int required,
                         int positional, const bd_argument *rows);

/* Does this hide values behind a mask of numpy.ma, as a list or tuple within it may? NumPy itself
 * would take them for real. -1 with an exception. */
int bd_convert_is_masked(PyObject *object);

/* A new reference to a C-contiguous, aligned, native float64 array of the given shape (BD_ANY where
 * free; ndim BD_ANY: any shape), all finite, none masked; NULL with an exception that names the
 * argument and, for a value, its index. No copy is made where none is needed: the caller's own
 * array may come back, so the data must be copied before the GIL is released. */
PyArrayObject *bd_convert_array(PyObject *object, const char *name, int ndim,
                                const npy_intp *shape);

/* Does this array hold numbers that float64 represents (NumPy's safe casting, no bool)? */
int bd_convert_is_real(PyArrayObject *array);

#define BD_SHAPE_SIZE 160
/* "(60,)", "(n, 2)": as Python prints a shape, n where a dimension is BD_ANY. */
void bd_convert_shape_text(char text[BD_SHAPE_SIZE], int ndim, const npy_intp *shape);

#endif
