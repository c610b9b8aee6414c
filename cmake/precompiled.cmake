# Headers of other projects that most files include, compiled once for each kind of target instead of once a file. A file
# includes what it needs all the same, and must compile without them, as it does where ccache is used, which would keep
# nothing of what is compiled with them.
set(precompile_default ON)
if(CMAKE_CXX_COMPILER_LAUNCHER)
  set(precompile_default OFF)
endif()
option(VOXKIT_PRECOMPILE "compile the headers of libraries once" ${precompile_default})

set(precompiled_libraries
  <algorithm> <array> <atomic> <bit> <cmath> <cstdint> <cstring> <fmt/format.h> <functional> <glm/glm.hpp> <limits> <map> <memory>
  <mutex> <optional> <span> <string> <string_view> <tl/expected.hpp> <utility> <vector>)
set(precompiled_programs ${precompiled_libraries} <chrono> <cstdio> <filesystem>)
set(precompiled_tests ${precompiled_programs} <cstdlib> <fstream> <gtest/gtest.h> <random> <set>)

# What compiles them: a target of one empty file with the flags that all targets of this kind have.
function(voxkit_precompile kind)
  if(VOXKIT_PRECOMPILE)
    set(target voxkit_precompiled_${kind})
    file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled_${kind}.cc CONTENT "// Nothing.\n")
    add_library(${target} OBJECT EXCLUDE_FROM_ALL ${CMAKE_BINARY_DIR}/precompiled_${kind}.cc)
    target_link_libraries(${target} PRIVATE fmt::fmt glm::glm tl::expected ${ARGN})
    target_precompile_headers(${target} PRIVATE ${precompiled_${kind}})
    if(NOT kind STREQUAL libraries)
      set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
      target_compile_options(${target} PRIVATE ${CMAKE_CXX_COMPILE_OPTIONS_PIE})
    endif()
  endif()
endfunction()

# A target is compiled with those of its kind. g++ 12 forgets that they are of the system, and then sees overflows of
# strings that are none (its bugs 105329 and 105651); compiled without them, the same files are still asked about these.
function(voxkit_precompiled target kind)
  if(VOXKIT_PRECOMPILE)
    target_precompile_headers(${target} REUSE_FROM voxkit_precompiled_${kind})
    target_compile_options(${target} PRIVATE
      "$<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-array-bounds;-Wno-restrict;-Wno-stringop-overflow;-Wno-stringop-overread>")
  endif()
endfunction()
