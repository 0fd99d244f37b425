# Manual pages (target throng_manual, where help2man is found) and shell completion.
find_program(THRONG_HELP2MAN help2man)
if(THRONG_HELP2MAN)
  add_custom_target(throng_manual
    COMMAND ${PROJECT_SOURCE_DIR}/deploy/manual ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${PROJECT_BINARY_DIR}/man
    DEPENDS throng throng-server throng-render throng-bake
    COMMENT "Manual pages in ${PROJECT_BINARY_DIR}/man" VERBATIM)
  install(DIRECTORY ${PROJECT_BINARY_DIR}/man/ DESTINATION share/man/man1 OPTIONAL)
endif()
install(FILES deploy/completion/throng.bash DESTINATION share/bash-completion/completions RENAME throng)
