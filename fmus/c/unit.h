/* For components written in C: from their three functions to those of fmi_unit.h.
 *
 * The component's file includes variables.h, which `yawbench build` generates from modelDescription.xml
 * (`Variables`: a double per variable, by name), and then defines
 *
 *     State                                           the state between steps
 *     void start(State *, const Variables *, double t)              sets the state at start time
 *     void advance(State *, const Variables *, double t, double h)  advances the state from t to t + h
 *     void output(const State *, Variables *, double t)             sets all outputs at t
 *
 * all static, and includes this file last. As with a component in Python, outputs are computed when they
 * are read until initialization ends, and after every step from then on; parameters out of range are
 * refused with a sentence. State and variables are saved and restored as a memory image, so a State must
 * not contain pointers. */
#if defined __GNUC__
#pragma GCC system_header /* warnings of the compiler are about the component */
#endif
/* The component may have functions of these names. */
#define begin unit_begin
#define copy unit_copy
#define discard unit_discard
#define drop unit_drop
#define end unit_end
#define fail unit_fail
#define forget unit_forget
#define item unit_item
#define make unit_make
#define push unit_push
#define refresh unit_refresh
#define replace unit_replace
#define restore unit_restore
#define save unit_save
#define say unit_say
#define step unit_step
#include "declared.h"

typedef struct {
    char nothing;
} Configured;

enum { N_LISTS = 0 };
static const int WIDTHS[] = {0};

static int configure_unit(Problem *problem, const Variables *v, Configured *c)
{
    return 0;
}

static int start_unit(Problem *problem, const Variables *v, const Configured *c, State *s, List *lists, double t)
{
    memset(s, 0, sizeof *s);
    start(s, v, t);
    return 0;
}

static int advance_unit(Problem *problem, const Variables *v, const Configured *c, State *s, List *lists, double t,
                        double h)
{
    advance(s, v, t, h);
    return 0;
}

/* The component sets its outputs in the instance's own variables, where those that it does not set stay. */
static int output_unit(Problem *problem, Variables *v, const Configured *c, const State *s, const List *lists,
                       double *y, double t)
{
    output(s, v, t);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        if (DECLARED[i].causality == OUTPUT) {
            y[OUTPUT_NUMBERS[i]] = ((const double *)v)[i];
        }
    }
    return 0;
}

#define configure(problem, v, c) configure_unit(problem, v, c)
#define start(problem, v, c, s, lists, t) start_unit(problem, v, c, s, lists, t)
#define advance(problem, v, c, s, lists, t, h) advance_unit(problem, v, c, s, lists, t, h)
#define output(problem, v, c, s, lists, y, t) output_unit(problem, v, c, s, lists, y, t)
#define OUTPUT_NUMBER(i) OUTPUT_NUMBERS[i]
#include "fmi_unit.h"
