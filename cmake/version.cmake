# SPDX-License-Identifier: Apache-2.0
# Which Takt this is: release, commit, and the sources that decide what a rollout computes.
#
#   include(version)               takt_identify(ROOT RELEASE) sets takt_version and takt_source_sha256
#   cmake -DROOT=... -DRELEASE=... -DOUT=... -P version.cmake     writes them as a C++ source, if they changed
#
# takt_version: 0.2.0+git834.feebbd09a1b2, and .dirty where tracked files differ from the commit. The number counts the
# commit's ancestors and itself, so that dpkg orders builds. Outside a checkout: 0.2.0+src.45d7c9006040, of the sources' hash.

function(takt_identify root release)
  set(sources)
  foreach(room executive config drivers policy_host monitor simulation evidence lab)
    file(GLOB_RECURSE found RELATIVE ${root} ${root}/${room}/*.cpp ${root}/${room}/*.hpp ${root}/${room}/CMakeLists.txt)
    list(APPEND sources ${found})
  endforeach()
  list(SORT sources)
  set(text "")
  foreach(source ${sources})
    file(SHA256 ${root}/${source} hash)
    string(APPEND text "${source} ${hash}\n")
  endforeach()
  string(SHA256 hash "${text}")
  string(SUBSTRING ${hash} 0 12 short)
  set(of_sources "${release}+src.${short}")

  # Sources unpacked inside another checkout are not that checkout's.
  execute_process(COMMAND git rev-parse --show-prefix WORKING_DIRECTORY ${root} OUTPUT_VARIABLE prefix RESULT_VARIABLE no_checkout
                  OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  set(version ${of_sources})
  if(NOT no_checkout AND prefix STREQUAL "")
    execute_process(COMMAND git rev-list --count HEAD WORKING_DIRECTORY ${root} OUTPUT_VARIABLE count
                    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    execute_process(COMMAND git describe --always --dirty=.dirty --abbrev=12 --exclude=* WORKING_DIRECTORY ${root}
                    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(count AND commit)
      set(version "${release}+git${count}.${commit}")
    endif()
  endif()
  set(takt_version ${version} PARENT_SCOPE)
  set(takt_source_sha256 ${hash} PARENT_SCOPE)
endfunction()

function(takt_write_version out release version source_sha256)
  file(CONFIGURE OUTPUT ${out} @ONLY CONTENT [[
// Generated.
#include "executive/contract/version.hpp"

namespace takt {
std::string_view release() { return "@release@"; }
std::string_view version() { return "@version@"; }
std::string_view source_sha256() { return "@source_sha256@"; }
}  // namespace takt
]])
endfunction()

if(CMAKE_SCRIPT_MODE_FILE AND DEFINED OUT)
  cmake_minimum_required(VERSION 3.25)
  takt_identify(${ROOT} ${RELEASE})
  takt_write_version(${OUT} ${RELEASE} ${takt_version} ${takt_source_sha256})
endif()
