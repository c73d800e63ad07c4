# SPDX-License-Identifier: Apache-2.0
# How every target of the project is compiled: one place for language, warnings, determinism and sanitizers.

set(CMAKE_CXX_STANDARD 23)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)

set(TAKT_SANITIZE "" CACHE STRING "Sanitizers for every target: empty, \"address,undefined\" or \"thread\"")

find_program(TAKT_CCACHE ccache)
if(TAKT_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${TAKT_CCACHE})
endif()

add_library(takt_options INTERFACE)
target_include_directories(takt_options INTERFACE ${CMAKE_SOURCE_DIR} ${CMAKE_BINARY_DIR}/generated)
target_compile_options(takt_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor -Wold-style-cast
  -Wcast-align -Woverloaded-virtual -Wformat=2 -Wimplicit-fallthrough -Wswitch-enum -Werror
  # Replay promises equal bits: no contraction into fused multiply-add, no value-changing optimisation.
  -ffp-contract=off -fno-fast-math
  # clang sees libstdc++ 12's own std::stable_sort call what libstdc++ 12 calls deprecated.
  $<$<CXX_COMPILER_ID:Clang>:-Wno-deprecated-declarations>)
# What a programming error may cost: a write beyond an array ends the program where the compiler can see its size. Sanitizers see
# more. No -fcf-protection: Debian 12's start files lack its mark, so no loader would switch it on.
if(NOT TAKT_SANITIZE)
  add_compile_options($<$<CONFIG:RelWithDebInfo>:-fstack-protector-strong> $<$<CONFIG:RelWithDebInfo>:-U_FORTIFY_SOURCE>
    $<$<CONFIG:RelWithDebInfo>:-D_FORTIFY_SOURCE=3>)
endif()
if(TAKT_SANITIZE)
  # Instrumented code makes g++ see uninitialised values in <regex> and <functional> that are none.
  target_compile_options(takt_options INTERFACE -fsanitize=${TAKT_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_link_options(takt_options INTERFACE -fsanitize=${TAKT_SANITIZE})
endif()

# For folders that read and write text: what is neither in the loop nor arithmetic is compiled in half the time without -O2.
set(TAKT_TEXT $<$<CONFIG:RelWithDebInfo>:-O1>)
set(TAKT_ARITHMETIC $<$<CONFIG:RelWithDebInfo>:-O2>) # for targets in such a folder that compute

# For libraries whose functions run in every tick, real or virtual. Archives are position-independent, so that the compiler reckons
# with a program that replaces one of their functions by its own; none does: calls within a file may be inlined.
set(TAKT_EVERY_TICK -fno-semantic-interposition)

# A first build in half the time: a target's sources are compiled several at once, so that headers are read once for all of
# them. Their file-local names must differ therefore. Off for those who edit them (./dev build).
option(TAKT_UNITY_BUILD "Compile several sources of a target at once" ON)
set(CMAKE_UNITY_BUILD ${TAKT_UNITY_BUILD})
set(CMAKE_UNITY_BUILD_BATCH_SIZE 24)

# takt_library(NAME SOURCES... DEPENDS...) ; without sources it is header-only.
function(takt_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  if(ARG_SOURCES)
    add_library(${name} STATIC ${ARG_SOURCES})
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    target_link_libraries(${name} PUBLIC takt_options ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
  else()
    add_library(${name} INTERFACE)
    target_link_libraries(${name} INTERFACE takt_options ${ARG_DEPENDS})
  endif()
endfunction()

# takt_program(NAME SOURCES... DEPENDS... [COMPONENT package]); without a component it comes with package takt.
function(takt_program name)
  cmake_parse_arguments(ARG "" "COMPONENT" "SOURCES;DEPENDS" ${ARGN})
  if(NOT ARG_COMPONENT)
    set(ARG_COMPONENT ${CMAKE_INSTALL_DEFAULT_COMPONENT_NAME})
  endif()
  add_executable(${name} ${ARG_SOURCES} $<TARGET_OBJECTS:takt_program_version>)
  target_link_libraries(${name} PRIVATE takt_options ${ARG_DEPENDS})
  # No symbol is looked up while it runs: inside the loop that is time that is not planned.
  target_link_options(${name} PRIVATE LINKER:-z,now)
  set_property(GLOBAL APPEND PROPERTY TAKT_PROGRAMS ${name})
  set_property(GLOBAL APPEND PROPERTY TAKT_INSTALLED ${name})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ${ARG_COMPONENT})
endfunction()

# takt_engine(NAME SOURCES... DEPENDS... COMPONENT...): a plugin of the policy host (policy_host/takt/engine.h), in lib/takt/engines
# of the installation as in the build folder.
set(TAKT_ENGINES ${CMAKE_INSTALL_LIBDIR}/takt/engines)
function(takt_engine name)
  cmake_parse_arguments(ARG "" "COMPONENT" "SOURCES;DEPENDS" ${ARGN})
  set(target takt-engine-${name})
  set(map ${CMAKE_SOURCE_DIR}/policy_host/engines/engine.map)
  add_library(${target} MODULE ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE takt_options ${ARG_DEPENDS})
  # What a library inside it is called is its own business, nor may it be taken for another library's.
  target_link_options(${target} PRIVATE LINKER:--version-script=${map} LINKER:--exclude-libs,ALL LINKER:--as-needed LINKER:-z,now)
  set_target_properties(${target} PROPERTIES PREFIX "" CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON
    LINK_DEPENDS ${map} LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/${TAKT_ENGINES})
  set_property(GLOBAL APPEND PROPERTY TAKT_INSTALLED ${target})
  set_property(GLOBAL APPEND PROPERTY TAKT_ENGINE_TARGETS ${target})
  if(ARG_COMPONENT)
    install(TARGETS ${target} LIBRARY DESTINATION ${TAKT_ENGINES} COMPONENT ${ARG_COMPONENT})
  endif()
endfunction()

# takt_test(NAME SOURCES... DEPENDS... LABELS...): one GoogleTest program, one CTest entry; of `process` tests, one entry
# NAME.CASE for each case, so that one which a stall broke is all that runs again. APART: sources whose file-local names others
# have too.
# Labels: `tsan` tests also run under ThreadSanitizer; `process` tests start real processes. Those run side by side, but
# for those that are ALONE: what they watch is the whole machine.
function(takt_test name)
  cmake_parse_arguments(ARG "ALONE" "TIMEOUT" "SOURCES;DEPENDS;LABELS;APART" ${ARGN})
  add_executable(${name} ${ARG_SOURCES} ${ARG_APART})
  set_source_files_properties(${ARG_APART} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  target_link_libraries(${name} PRIVATE takt_options ${ARG_DEPENDS} GTest::gtest GTest::gtest_main)
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
    if(TAKT_SANITIZE)
      set(ARG_TIMEOUT 600) # a sanitizer multiplies what a test takes, and fresh memory most
    endif()
  endif()
  if(ARG_LABELS STREQUAL "process" AND NOT TAKT_SANITIZE)
    gtest_discover_tests(${name} TEST_PREFIX "${name}." WORKING_DIRECTORY ${CMAKE_SOURCE_DIR} DISCOVERY_MODE PRE_TEST
      PROPERTIES LABELS process TIMEOUT ${ARG_TIMEOUT} RUN_SERIAL ${ARG_ALONE})
  else()
    add_test(NAME ${name} COMMAND ${name} WORKING_DIRECTORY ${CMAKE_SOURCE_DIR})
    set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
  endif()
  if(TAKT_SANITIZE AND NOT "process" IN_LIST ARG_LABELS AND NOT "slow" IN_LIST ARG_LABELS)
    set_property(GLOBAL APPEND PROPERTY TAKT_SANITIZED_TESTS ${name})
  endif()
  if("tsan" IN_LIST ARG_LABELS)
    set_property(GLOBAL APPEND PROPERTY TAKT_TSAN_TESTS ${name})
  endif()
endfunction()
