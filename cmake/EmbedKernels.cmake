# clratio_embed(OUTPUT FILES...): a C++ file that holds each file's bytes under its path, as
# clratio::embedded_files. Run with -P it writes the file; included, it defines the function.
if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  set(table "")
  set(text "// Made by cmake/EmbedKernels.cmake.\n#include \"embedded.hpp\"\n\nnamespace clratio {\nnamespace {\n")
  set(index 0)
  string(REPLACE "|" ";" FILES "${FILES}")
  foreach(file IN LISTS FILES)
    file(READ ${ROOT}/${file} hex HEX)
    string(REGEX REPLACE "(..)" "'\\\\x\\1'," bytes "${hex}")
    string(APPEND text "constexpr char file${index}[] = {${bytes}};\n")
    string(REGEX REPLACE "^include/" "" name ${file})
    string(APPEND table "    {\"${name}\", {file${index}, sizeof file${index}}},\n")
    math(EXPR index "${index} + 1")
  endforeach()
  string(APPEND text "\nconstexpr std::array<EmbeddedFile, ${index}> files{{\n${table}}};\n}  // namespace\n\n")
  string(APPEND text "constinit const std::span<const EmbeddedFile> embedded_files{files};\n}  // namespace clratio\n")
  file(WRITE ${OUTPUT} "${text}")
  return()
endif()

set(CLRATIO_EMBED_SCRIPT ${CMAKE_CURRENT_LIST_FILE})
function(clratio_embed output)
  list(TRANSFORM ARGN PREPEND ${PROJECT_SOURCE_DIR}/ OUTPUT_VARIABLE inputs)
  list(JOIN ARGN "|" files)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DOUTPUT=${output} "-DFILES=${files}" -P ${CLRATIO_EMBED_SCRIPT}
    DEPENDS ${inputs} ${CLRATIO_EMBED_SCRIPT}
    COMMENT "Embedding kernels"
    VERBATIM)
endfunction()
