# `cmake --install` and `cpack -G DEB`. PREFIX/lib/subworld is as `bin` of the build: programs, plug-ins and settings beside
# each other. PREFIX/bin has links to those programs that users call. Tools, laboratories, engines and drivers are installed
# where they are built.
set(subworld_programs subworld world_sim haptic_sim device_sim gui_headless)
set(optional ${engines} ${tools} ${labs} ${devices})
foreach(vendor fastdds cyclonedds)
  if(TARGET subworld_${vendor})
    list(APPEND optional subworld_${vendor})
  endif()
endforeach()
install(TARGETS ${subworld_programs} RUNTIME DESTINATION lib/subworld COMPONENT programs)
install(TARGETS ${optional} RUNTIME DESTINATION lib/subworld COMPONENT programs OPTIONAL
                            LIBRARY DESTINATION lib/subworld COMPONENT programs OPTIONAL)
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/links)
foreach(program ${subworld_programs})
  file(CREATE_LINK ../lib/subworld/${program} ${CMAKE_BINARY_DIR}/links/${program} SYMBOLIC)
  install(FILES ${CMAKE_BINARY_DIR}/links/${program} DESTINATION bin COMPONENT programs)
endforeach()
install(DIRECTORY deploy/qos DESTINATION lib/subworld COMPONENT programs)
install(FILES deploy/systemd/subworld-session@.service DESTINATION lib/systemd/system COMPONENT programs)

install(DIRECTORY deploy/scenes deploy/sessions DESTINATION share/subworld COMPONENT data
        PATTERN .subworld EXCLUDE PATTERN *.md EXCLUDE)
install(FILES idl/subworld.idl deploy/results/subworld_results.py DESTINATION share/subworld COMPONENT data)
install(FILES deploy/python/subworld.py deploy/python/subworld_study.py deploy/python/subworld_study_page.py
              deploy/results/subworld_results.py
        DESTINATION lib/python3/dist-packages COMPONENT programs)
if(TARGET subworld_core)
  install(TARGETS subworld_core LIBRARY DESTINATION lib/python3/dist-packages COMPONENT programs OPTIONAL)
endif()
install(FILES deploy/python/study.yaml deploy/python/staircase.yaml
        DESTINATION share/doc/subworld/deploy/python COMPONENT documentation)
install(PROGRAMS deploy/python/study DESTINATION lib/subworld RENAME subworld_study COMPONENT programs)

# Pages with their pictures, in the folders to which their links lead; and what the programs say of themselves.
file(GLOB_RECURSE pages RELATIVE ${PROJECT_SOURCE_DIR} CONFIGURE_DEPENDS
     common/*.md deploy/*.md device_sim/*.md gui_headless/*.md gui_headless/*.png haptic_sim/*.md tests/*.md world_sim/*.md)
list(FILTER pages EXCLUDE REGEX node_modules)
foreach(page README.md CHANGELOG.md CONTRIBUTING.md LICENSE ${pages})
  get_filename_component(folder ${page} DIRECTORY)
  install(FILES ${page} DESTINATION share/doc/subworld/${folder} COMPONENT documentation)
endforeach()
foreach(tool ${tools})
  get_target_property(name ${tool} OUTPUT_NAME)
  list(APPEND further ${name})
endforeach()
install(CODE "set(bin [[${CMAKE_RUNTIME_OUTPUT_DIRECTORY}]])
              set(build [[${CMAKE_BINARY_DIR}]])
              set(licence [[${PROJECT_SOURCE_DIR}/LICENSE]])
              set(head [[${CMAKE_CURRENT_LIST_DIR}/completion.bash]])
              set(programs ${subworld_programs})
              set(further ${further} ${labs})" COMPONENT documentation)
install(SCRIPT ${CMAKE_CURRENT_LIST_DIR}/manual.cmake COMPONENT documentation)

# The reference of the libraries, of the comments in their headers: `deploy/build api`.
find_package(Doxygen QUIET)
if(DOXYGEN_FOUND)
  set(DOXYGEN_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/api)
  set(DOXYGEN_PROJECT_BRIEF "distributed simulation of rigid bodies that users feel")
  set(DOXYGEN_STRIP_FROM_PATH common tests deploy .)
  set(DOXYGEN_STRIP_FROM_INC_PATH common tests .)
  set(DOXYGEN_MACRO_EXPANSION YES)
  set(DOXYGEN_EXTRACT_ALL YES)
  set(DOXYGEN_HIDE_FRIEND_COMPOUNDS YES)
  set(DOXYGEN_SORT_MEMBER_DOCS NO)
  set(DOXYGEN_HAVE_DOT NO)
  set(DOXYGEN_VERBATIM_HEADERS NO)
  set(DOXYGEN_FILE_PATTERNS *.hpp)
  set(DOXYGEN_USE_MDFILE_AS_MAINPAGE deploy/examples/README.md)
  set(DOXYGEN_WARN_AS_ERROR FAIL_ON_WARNINGS)
  set(DOXYGEN_QUIET YES)
  file(GLOB DOXYGEN_HTML_EXTRA_FILES CONFIGURE_DEPENDS deploy/examples/*.?pp)
  doxygen_add_docs(api deploy/examples/README.md common world_sim haptic_sim device_sim tests/lab/session
                   COMMENT "the reference of the libraries")
  install(DIRECTORY ${CMAKE_BINARY_DIR}/api/html/ DESTINATION share/doc/subworld/api COMPONENT development OPTIONAL)
endif()

# For programs that simulate in their own process: find_package(Subworld), then Subworld::world and so on.
set(libraries model plugin physics coupling wire rt io program)
foreach(library ${libraries})
  set_target_properties(subworld_${library} PROPERTIES EXPORT_NAME ${library})
endforeach()
list(TRANSFORM libraries PREPEND subworld_)
set_target_properties(subworld_lab_session PROPERTIES EXPORT_NAME lab)
list(APPEND libraries subworld_lab_session)
foreach(name world haptic device)
  set_target_properties(${name}_sim_core PROPERTIES EXPORT_NAME ${name})
  list(APPEND libraries ${name}_sim_core)
endforeach()
install(TARGETS ${libraries} EXPORT SubworldTargets ARCHIVE DESTINATION lib/subworld COMPONENT development OPTIONAL
                             INCLUDES DESTINATION include/subworld)
install(EXPORT SubworldTargets NAMESPACE Subworld:: DESTINATION lib/cmake/Subworld COMPONENT development)
install(DIRECTORY common/ world_sim haptic_sim device_sim DESTINATION include/subworld COMPONENT development
        FILES_MATCHING PATTERN *.hpp)
install(DIRECTORY tests/lab/session DESTINATION include/subworld/lab COMPONENT development FILES_MATCHING PATTERN *.hpp)
include(CMakePackageConfigHelpers)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/SubworldConfigVersion.cmake COMPATIBILITY ExactVersion)
install(FILES deploy/SubworldConfig.cmake deploy/installed_programs.cpp
              ${CMAKE_BINARY_DIR}/SubworldConfigVersion.cmake
        DESTINATION lib/cmake/Subworld COMPONENT development)
install(DIRECTORY deploy/examples DESTINATION share/doc/subworld/deploy COMPONENT development PATTERN *.md EXCLUDE)

# Two packages of Debian: subworld, and subworld-dev. Libraries are found by dpkg-shlibdeps. What is started by its name,
# and by some commands only, is recommended or suggested.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "The authors of Subworld <subworld@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "distributed simulation of rigid bodies that users feel")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME subworld)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS "gnuplot-nox, openssl, python3-pandas, python3-yaml")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS "ffmpeg, openssh-client, xdg-utils")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME subworld-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "subworld (= ${PROJECT_VERSION}), cmake, libeigen3-dev, libfmt-dev, \
libyaml-cpp-dev, libassimp-dev, nlohmann-json3-dev, zlib1g-dev")
include(CPack)
foreach(component programs data documentation)
  cpack_add_component(${component} GROUP programs)
endforeach()
cpack_add_component(development GROUP development)
