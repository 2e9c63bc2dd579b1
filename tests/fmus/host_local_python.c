/* A host that has loaded Python with local symbols, as a plug-in would, and then loads an FMU. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2.h"
static void logger(fmi2ComponentEnvironment e, fmi2String i, fmi2Status s, fmi2String c, fmi2String m, ...)
{
    (void)e;
    (void)i;
    (void)s;
    (void)c;
    fprintf(stderr, "%s\n", m);
}
static fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
int main(int argc, char *argv[])
{
    (void)argc;
    void *python = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL), *symbol = dlsym(python, "Py_InitializeEx");
    void (*start)(int);
    void *(*let_go)(void);
    memcpy(&start, &symbol, sizeof symbol);
    start(0);
    symbol = dlsym(python, "PyEval_SaveThread");
    memcpy(&let_go, &symbol, sizeof symbol);
    let_go();
    if (dlsym(RTLD_DEFAULT, "Py_IsInitialized") != NULL)
        return 4;
    void *library = dlopen(argv[2], RTLD_NOW | RTLD_LOCAL);
    fmi2InstantiateFn make;
    symbol = dlsym(library, "fmi2Instantiate");
    memcpy(&make, &symbol, sizeof symbol);
    return make("unit", fmi2CoSimulation, argv[4], argv[3], &callbacks, fmi2False, fmi2False) == NULL;
}
