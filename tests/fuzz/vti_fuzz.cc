#include "tests/fuzz/target.h"

VOXKIT_FUZZ_TARGET(read_vti)
