# cmake -DROOT=... -DOUT=... -P source_hash.cmake: a header with the SHA-256 over every source that decides what a
# rollout computes, so that an artifact names its script exactly. Written only when it changes.
cmake_minimum_required(VERSION 3.25)
set(sources)
foreach(room executive config drivers policy_host monitor simulation evidence)
  file(GLOB_RECURSE found RELATIVE ${ROOT} ${ROOT}/${room}/*.cpp ${ROOT}/${room}/*.hpp ${ROOT}/${room}/CMakeLists.txt)
  list(APPEND sources ${found})
endforeach()
list(SORT sources)
set(text "")
foreach(source ${sources})
  file(SHA256 ${ROOT}/${source} hash)
  string(APPEND text "${source} ${hash}\n")
endforeach()
string(SHA256 hash "${text}")
file(CONFIGURE OUTPUT ${OUT} @ONLY CONTENT
  "// Generated.\n#pragma once\n#define TAKT_SOURCE_SHA256 \"@hash@\"\n")
