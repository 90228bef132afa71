/* The model of the FMU. */
#include "LW_FILE_model.h"

#include <string.h>

