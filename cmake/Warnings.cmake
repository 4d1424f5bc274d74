# clratio_exact_bits(TARGET): no contraction of a*b+c behind the code's back; the promise of the same bits rests on it.
function(clratio_exact_bits target)
  target_compile_options(${target} PRIVATE -ffp-contract=off)
endfunction()

# clratio_warnings(TARGET): the house's warnings.
function(clratio_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wconversion -Wshadow)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    target_compile_options(${target} PRIVATE -Wno-restrict)  # false alarms on std::string + (GCC bug 105651)
  endif()
  if(CLRATIO_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
