# Installs a build into an empty prefix, then builds and runs the consumer against it: once through
# find_package, once through pkg-config.
# Needs BUILD_DIR, WORK_DIR, LIBDIR, CXX and CXX_FLAGS.
cmake_minimum_required(VERSION 3.25)

function(run)
  execute_process(COMMAND ${ARGV} WORKING_DIRECTORY ${WORK_DIR} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

set(prefix ${WORK_DIR}/prefix)
set(by_cmake ${WORK_DIR}/by-cmake)
set(by_pkg_config ${WORK_DIR}/by-pkg-config)
file(REMOVE_RECURSE ${WORK_DIR})
file(MAKE_DIRECTORY ${by_pkg_config})
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${prefix})

run(${CMAKE_COMMAND} -G Ninja -S ${CMAKE_CURRENT_LIST_DIR} -B ${by_cmake}
  -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${CXX_FLAGS})
run(${CMAKE_COMMAND} --build ${by_cmake})
run(${by_cmake}/consumer)
if(EXISTS ${by_cmake}/lander)
  run(${by_cmake}/lander)
endif()
if(EXISTS ${by_cmake}/pilot)
  run(${by_cmake}/pilot)
endif()

set(ENV{PKG_CONFIG_PATH} ${prefix}/${LIBDIR}/pkgconfig)
set(ENV{LD_LIBRARY_PATH} ${prefix}/${LIBDIR})
function(run_by_pkg_config program source package)
  execute_process(COMMAND pkg-config --cflags --libs ${package}
    OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags UNIX_COMMAND "${CXX_FLAGS} ${flags}")
  run(${CXX} -std=c++17 ${CMAKE_CURRENT_LIST_DIR}/${source} -o ${by_pkg_config}/${program} ${flags})
  run(${by_pkg_config}/${program})
endfunction()
run_by_pkg_config(consumer main.cpp harco)
if(EXISTS ${prefix}/${LIBDIR}/pkgconfig/harco-land.pc)
  run_by_pkg_config(lander lander.cpp harco-land)
endif()
if(EXISTS ${prefix}/${LIBDIR}/pkgconfig/harco-autopilot.pc)
  run_by_pkg_config(pilot pilot.cpp harco-autopilot)
endif()

if(EXISTS ${prefix}/bin/harco)
  unset(ENV{LD_LIBRARY_PATH})
  run(${prefix}/bin/harco --version)
endif()
