# What a user does with the installed package, a step a test. Run with -P, and STEP, BINARY, SOURCE, GENERATOR, COMPILER and
# LAUNCHER set (see package.cmake):
#   install        the build, into BINARY/package/prefix
#   plain          tests/package: found with find_package, built, its own tests run
#   native         the same with -march=native -O3
#   core           tests/package/core: the library where there is no OpenEXR
#   shared         tests/package with shared libraries, compiled in a hurry and installed
#   pkg_config     readme.cpp, compiled by hand with what pkg-config says
#   subdirectory   tests/package/subdirectory, which takes the whole of clratio in, compiled in a hurry
#   readme         every C++ text of README.md stands in a program of tests/package
set(package ${BINARY}/package)
set(prefix ${package}/prefix)

function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

# configure FOLDER BUILD OPTION...
function(configure folder build)
  run(${CMAKE_COMMAND} -S ${folder} -B ${build} -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} ${ARGN})
endfunction()

# build_and_test FOLDER NAME OPTION...
function(build_and_test folder name)
  set(build ${package}/${name})
  file(REMOVE_RECURSE ${build})
  configure(${folder} ${build} -DCLRATIO_TEST_DATA=${SOURCE}/tests/data ${ARGN})
  run(${CMAKE_COMMAND} --build ${build})
  run(${CMAKE_CTEST_COMMAND} --test-dir ${build} --output-on-failure --no-tests=error)
endfunction()

# require_compiled(TEXT): it stands, as it is, in a program of tests/package.
function(require_compiled block)
  foreach(file IN LISTS files)
    file(READ ${file} program)
    string(FIND "${program}" "${block}" found)
    if(found GREATER_EQUAL 0)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "This text of README.md is in no program of tests/package:\n${block}")
endfunction()

if(STEP STREQUAL install)
  file(REMOVE_RECURSE ${prefix})
  run(${CMAKE_COMMAND} --install ${BINARY} --prefix ${prefix})
elseif(STEP STREQUAL plain)
  build_and_test(${SOURCE}/tests/package plain -DCMAKE_PREFIX_PATH=${prefix})
elseif(STEP STREQUAL native)
  build_and_test(${SOURCE}/tests/package native -DCMAKE_PREFIX_PATH=${prefix} "-DCMAKE_CXX_FLAGS=-march=native -O3")
elseif(STEP STREQUAL core)
  build_and_test(${SOURCE}/tests/package/core core -DCMAKE_PREFIX_PATH=${prefix})
elseif(STEP STREQUAL shared)
  set(build ${package}/shared_build)
  file(REMOVE_RECURSE ${build} ${package}/shared_prefix)
  configure(${SOURCE} ${build} -DBUILD_SHARED_LIBS=ON -DCMAKE_CXX_FLAGS_RELEASE=-O0 -DCLRATIO_TOOL=OFF -DCLRATIO_TESTS=OFF
    -DCLRATIO_BENCH=OFF)
  run(${CMAKE_COMMAND} --build ${build})
  run(${CMAKE_COMMAND} --install ${build} --prefix ${package}/shared_prefix)
  build_and_test(${SOURCE}/tests/package shared -DCMAKE_PREFIX_PATH=${package}/shared_prefix)
elseif(STEP STREQUAL pkg_config)
  file(GLOB_RECURSE files ${prefix}/clratio.pc ${prefix}/*/clratio.pc)
  list(GET files 0 file)
  cmake_path(GET file PARENT_PATH folder)
  set(ENV{PKG_CONFIG_PATH} ${folder})
  execute_process(COMMAND pkg-config --cflags --libs clratio_io OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags UNIX_COMMAND "${flags}")
  run(${COMPILER} -std=c++20 ${SOURCE}/tests/package/readme.cpp -o ${package}/readme ${flags})
  set(scene ${SOURCE}/tests/data/cycles/area)
  run(${package}/readme ${scene}/t_ref.exr ${package}/out.exr ${scene}/m_000.exr ${scene}/t_000.exr)
elseif(STEP STREQUAL subdirectory)
  build_and_test(${SOURCE}/tests/package/subdirectory subdirectory -DCLRATIO_SOURCE=${SOURCE}
    -DCMAKE_CXX_FLAGS_RELEASE=-O0)
elseif(STEP STREQUAL readme)
  file(READ ${SOURCE}/README.md text)
  file(GLOB files ${SOURCE}/tests/package/*.cpp)
  set(blocks 0)
  string(FIND "${text}" "```cpp\n" start)
  while(start GREATER_EQUAL 0)
    math(EXPR start "${start} + 7")
    string(SUBSTRING "${text}" ${start} -1 text)
    string(FIND "${text}" "```" length)
    string(SUBSTRING "${text}" 0 ${length} block)
    string(SUBSTRING "${text}" ${length} -1 text)
    require_compiled("${block}")
    math(EXPR blocks "${blocks} + 1")
    string(FIND "${text}" "```cpp\n" start)
  endwhile()
  if(blocks LESS 3)
    message(FATAL_ERROR "README.md has ${blocks} programs, not 3 or more")
  endif()
else()
  message(FATAL_ERROR "no step ${STEP}")
endif()
