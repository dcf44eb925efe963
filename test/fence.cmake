# Test: the core builds with what identifies, and one of its tests passes, where ROS is hidden; and no file of them
# reads a ROS header.
# The second half matters where ROS lies in /usr/include (Debian): there a stray include would compile.
# Arguments: SOURCE_DIR, SCRATCH_DIR, CXX_COMPILER.
cmake_minimum_required(VERSION 3.16)

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed (${result}): ${ARGN}")
  endif()
endfunction()

file(REMOVE_RECURSE ${SCRATCH_DIR})
# -MD: dependency files list system headers too; Ninja would delete them. -O0: only the outcome counts.
run(${CMAKE_COMMAND} -S ${SOURCE_DIR} -B ${SCRATCH_DIR} -G "Unix Makefiles" -DCMAKE_CXX_COMPILER=${CXX_COMPILER}
  -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS=-MD\ -O0\ -g0 -DCMAKE_DISABLE_FIND_PACKAGE_catkin=ON)
run(${CMAKE_COMMAND} --build ${SCRATCH_DIR} --target config_test brash_ice_identify -j2)
run(${SCRATCH_DIR}/config_test --gtest_brief=1)

file(GLOB_RECURSE dependency_files ${SCRATCH_DIR}/*.d)
set(core_files 0)
foreach(dependency_file ${dependency_files})
  if(dependency_file MATCHES "brash_ice_core")
    math(EXPR core_files "${core_files} + 1")
  endif()
  file(READ ${dependency_file} text)
  # The checkout itself may lie in a catkin workspace.
  string(REPLACE ${SCRATCH_DIR} "" text "${text}")
  string(REPLACE ${SOURCE_DIR} "" text "${text}")
  string(REGEX MATCH "[^ \n]*(/opt/ros|/ros/|/tf2|/catkin|_msgs/|/std_srvs/|/rviz/)[^ \n]*" header "${text}")
  if(header)
    message(FATAL_ERROR "the core reads a ROS header: ${header}, see ${dependency_file}")
  endif()
endforeach()
if(core_files LESS 5)
  message(FATAL_ERROR "found the dependencies of ${core_files} core files only; the check looks in the wrong place")
endif()
message(STATUS "${core_files} files of the core read no ROS header")
