/* controller_defaults.c - the controller's default robot, beside the plant's, which has a function
 * of the same name for the same version */
#define hx_version hx_controller_version

#include "../../../controller/fmu/generated/defaults.c"
