# SPDX-License-Identifier: Apache-2.0
# cmake -DOUT=file.cpp "-DFILES=name=path;name=path" -P embed_text.cmake
# Writes the files into a C++ source as string views of takt::evidence::assets. Files of one name are put one behind the
# other, in order.
set(source "#include \"evidence/review/report/report_assets.hpp\"\n\nnamespace takt::evidence::assets {\nnamespace {\n")
set(names "")
foreach(entry IN LISTS FILES)
  string(REGEX MATCH "^([^=]+)=(.+)$" matched "${entry}")
  set(name ${CMAKE_MATCH_1})
  file(READ "${CMAKE_MATCH_2}" bytes HEX)
  string(APPEND content_${name} "${bytes}")
  list(APPEND names ${name})
endforeach()
list(REMOVE_DUPLICATES names)
set(views "")
foreach(name IN LISTS names)
  string(LENGTH "${content_${name}}" digits)
  math(EXPR size "${digits} / 2")
  string(REGEX REPLACE "(..)" "'\\\\x\\1'," bytes "${content_${name}}")
  string(APPEND source "constexpr char ${name}_text[] = {${bytes}'\\0'};\n")
  string(APPEND views "extern const std::string_view ${name};\nconst std::string_view ${name}(${name}_text, ${size});\n")
endforeach()
file(WRITE "${OUT}" "${source}}  // namespace\n${views}}  // namespace takt::evidence::assets\n")
