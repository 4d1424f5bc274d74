# The tests of the installed package; package_test.cmake says what each step does.
function(clratio_package_test step)
  add_test(NAME package.${step} COMMAND ${CMAKE_COMMAND} -DSTEP=${step} -DBINARY=${PROJECT_BINARY_DIR}
    -DSOURCE=${PROJECT_SOURCE_DIR} -DGENERATOR=${CMAKE_GENERATOR} -DCOMPILER=${CMAKE_CXX_COMPILER}
    -DLAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER} -P ${CMAKE_CURRENT_SOURCE_DIR}/package_test.cmake)
  # They take long, and come last where ctest knows no times yet: then one would run alone.
  set_tests_properties(package.${step} PROPERTIES ${caches} COST 60)
endfunction()

clratio_package_test(readme)
clratio_package_test(subdirectory)
clratio_package_test(shared)
clratio_package_test(install)
set_tests_properties(package.install PROPERTIES FIXTURES_SETUP installed_package)
foreach(step plain native core pkg_config)
  clratio_package_test(${step})
  set_tests_properties(package.${step} PROPERTIES FIXTURES_REQUIRED installed_package)
endforeach()
