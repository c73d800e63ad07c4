# SPDX-License-Identifier: Apache-2.0
# The Debian packages: what they hold beside programs, units and exported libraries, and how CPack makes them (`./dev
# package`). `takt` is what a robot PC runs; `takt-lab` evaluates policies and runs; `takt-engine-torchscript` adds TorchScript; `takt-dev` builds policies, worlds and engines in C; `python3-takt` is for policies in Python.

# The demo robot, ready to start: what /etc/takt/deployments/demo points to, and /etc/takt/robot at first. It is no file of
# the owner's, so that no upgrade asks about it. Its buses have names that no adapter has: a simulated robot must never meet real drives.
function(takt_demo_robot out)
  file(READ ${CMAKE_SOURCE_DIR}/config/arm6.yaml text)
  foreach(change "cpu: 1 =>cpu: none" "interface: can=>interface: demo" "file: arm6_reach.onnx =>file: /usr/share/takt/robots/arm6_reach.onnx"
                 "directory: runs\n=>directory: /var/lib/takt/runs\n")
    string(REPLACE "=>" ";" change "${change}")
    list(GET change 0 from)
    list(GET change 1 to)
    string(FIND "${text}" "${from}" at)
    if(at EQUAL -1)
      message(FATAL_ERROR "config/arm6.yaml no longer says `${from}`: correct cmake/TaktPackage.cmake")
    endif()
    string(REPLACE "${from}" "${to}" text "${text}")
  endforeach()
  file(CONFIGURE OUTPUT ${out}/robot.yaml CONTENT "${text}" @ONLY)
  file(CONFIGURE OUTPUT ${out}/simulated CONTENT
    "While this file is here, takt-plant.service plays this robot's drives, mechanics and camera.\n")
endfunction()

set(share ${CMAKE_BINARY_DIR}/share)
set(package_files ${CMAKE_SOURCE_DIR}/cmake/package)

# Of the newest commit, so that the same sources give the same package.
execute_process(COMMAND git log -1 --format=%cD WORKING_DIRECTORY ${CMAKE_SOURCE_DIR} OUTPUT_VARIABLE takt_date
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT takt_date)
  set(takt_date "Thu, 01 Jan 1970 00:00:00 +0000")
endif()

# Manual pages and shell completion, out of the programs themselves. Not part of `all`: only the package wants them.
add_custom_target(takt-manual
  COMMAND ${package_files}/manual.py $<TARGET_FILE_DIR:takt> ${PROJECT_VERSION} ${share}
  DEPENDS takt takt-executive takt-policy-host takt-plant takt-monitor takt-imu $<TARGET_NAME_IF_EXISTS:takt-ros-sensors> takt-policy-bridge takt-policy-server
  COMMENT "Manual pages and shell completion")
# What is in the programs, by the programs and this machine's packages.
add_custom_command(TARGET takt-manual POST_BUILD VERBATIM
  COMMAND ${package_files}/sbom.py ${PROJECT_VERSION} ${takt_date} ${share}/takt.spdx.json $<TARGET_FILE_DIR:takt>
  COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_BINARY_DIR}/package-check
  COMMAND ${CMAKE_STRIP} -o ${CMAKE_BINARY_DIR}/package-check/check-robot $<TARGET_FILE:takt-check-robot>)
add_dependencies(takt-manual takt-check-robot)
# A packager asks for this target alone: all that is packed comes with it.
get_property(installed GLOBAL PROPERTY TAKT_INSTALLED)
add_dependencies(takt-manual ${installed})
install(DIRECTORY ${share}/man ${share}/bash-completion ${share}/zsh ${share}/fish DESTINATION ${CMAKE_INSTALL_DATADIR} OPTIONAL)
if(TAKT_WITH_LAB)
  add_dependencies(takt-manual takt-lab)
  install(DIRECTORY ${share}/lab/man DESTINATION ${CMAKE_INSTALL_DATADIR} COMPONENT lab OPTIONAL)
endif()

# By commit, so that two builds of one release are two packages and dpkg knows the newer one. `./dev package` configures anew.
takt_identify(${CMAKE_SOURCE_DIR} ${PROJECT_VERSION})
set(CPACK_PACKAGE_VERSION ${takt_version})

# Debian wants its own changelog, dated.
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "Takt maintainers <takt@example.org>")
configure_file(${package_files}/changelog.in ${share}/doc/changelog.Debian @ONLY)
file(COPY_FILE ${CMAKE_SOURCE_DIR}/CHANGELOG.md ${share}/doc/changelog)
execute_process(COMMAND gzip -9nf changelog.Debian changelog WORKING_DIRECTORY ${share}/doc)

set(docs ${CMAKE_INSTALL_DATADIR}/doc/takt)
install(FILES ${share}/doc/changelog.Debian.gz ${share}/doc/changelog.gz ${package_files}/copyright README.md SECURITY.md DESTINATION ${docs})
install(FILES ${share}/takt.spdx.json DESTINATION ${docs} OPTIONAL)
install(DIRECTORY docs DESTINATION ${docs} FILES_MATCHING PATTERN "*.md" PATTERN "*.svg" PATTERN "*.xml" PATTERN examples EXCLUDE)
install(DIRECTORY drivers/dbc DESTINATION ${CMAKE_INSTALL_DATADIR}/takt)
install(DIRECTORY config/ DESTINATION ${CMAKE_INSTALL_DATADIR}/takt/robots
        FILES_MATCHING PATTERN "*.yaml" PATTERN "*.onnx" PATTERN "*.xml" REGEX "/shown/[^/]*[.]json$"
        PATTERN grafana EXCLUDE PATTERN prometheus EXCLUDE PATTERN drives EXCLUDE)

takt_demo_robot(${CMAKE_BINARY_DIR}/demo)
install(DIRECTORY ${CMAKE_BINARY_DIR}/demo DESTINATION ${CMAKE_INSTALL_DATADIR}/takt)
install(FILES ${package_files}/needrestart.conf DESTINATION /etc/needrestart/conf.d RENAME takt.conf)

set(dev_docs ${CMAKE_INSTALL_DATADIR}/doc/takt-dev)
install(FILES ${share}/doc/changelog.Debian.gz ${share}/doc/changelog.gz ${package_files}/copyright
        DESTINATION ${dev_docs} COMPONENT dev)
install(DIRECTORY docs/examples DESTINATION ${dev_docs} COMPONENT dev)
install(FILES client/javascript/takt-world.mjs DESTINATION ${dev_docs}/examples/world COMPONENT dev)
install(FILES ${share}/doc/changelog.Debian.gz ${share}/doc/changelog.gz ${package_files}/copyright
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-takt COMPONENT python)
install(DIRECTORY client/python/takt DESTINATION lib/python3/dist-packages COMPONENT python PATTERN __pycache__ EXCLUDE)

# `./dev package` builds what is installed; packing must not build every test as well.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME takt)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL runtime dev python)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME takt)
set(CPACK_DEBIAN_DEV_PACKAGE_NAME takt-dev)
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-takt)
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/package)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON) # libtakt-client: who links it needs this very package
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY "=")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS "systemd | systemd-standalone-sysusers, systemd | systemd-standalone-tmpfiles, iproute2")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS "linux-image-rt-amd64 | linux-image-rt-arm64")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS "takt-lab, can-utils, lttng-tools, babeltrace2")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA ${package_files}/preinst ${package_files}/postinst ${package_files}/prerm ${package_files}/postrm
    ${package_files}/conffiles ${package_files}/triggers ${CMAKE_BINARY_DIR}/package-check/check-robot)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "") # each package has its own
set(CPACK_DEBIAN_RUNTIME_DESCRIPTION
"real-time executive for learned robot policies
Takt runs learned policies on robots in real time and leaves evidence behind
every command. A small hard-real-time process stands between the neural
network and the motors: every millisecond it decides whether the policy's last
word is still fresh enough to move the robot, keeps the robot inside its
limits, and records why, so that the decision can be replayed bit for bit.
.
This package holds the executive, the policy host for ONNX policies, the
monitor, a simulated robot, the takt command and systemd units. Nothing is
started when it is installed.")

# What was in package takt until there was this one.
if(TAKT_WITH_LAB)
  list(APPEND CPACK_COMPONENTS_ALL lab)
  install(FILES ${share}/doc/changelog.Debian.gz ${share}/doc/changelog.gz ${package_files}/copyright
          DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/takt-lab COMPONENT lab)
endif()
set(CPACK_DEBIAN_LAB_PACKAGE_NAME takt-lab)
set(CPACK_DEBIAN_LAB_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_LAB_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_LAB_PACKAGE_DEPENDS "takt (= ${takt_version}-1)")
set(CPACK_DEBIAN_LAB_PACKAGE_BREAKS "takt (<< ${takt_version}-1)")
set(CPACK_DEBIAN_LAB_PACKAGE_REPLACES "takt (<< ${takt_version}-1)")
set(CPACK_DEBIAN_LAB_DESCRIPTION
"evaluation of learned robot policies with Takt
Takt runs learned policies on robots in real time. This package holds what
tells good policies from bad ones: panels of rollouts and their artifacts,
paired comparisons, margins, budgets, audits and seals, the review of LTTng
traces, and the export of runs as data sets. No robot needs it to run.")

# What is built with it needs nothing of this package; what it talks to has to be of the same build.
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "gcc, libc6-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_RECOMMENDS "takt (= ${takt_version}-1), pkg-config | pkgconf")
set(CPACK_DEBIAN_DEV_DESCRIPTION
"policies, simulators and inference engines of your own for Takt
Takt runs learned policies on robots in real time. This package holds the
headers for what runs beside it: a policy or a sensor in C, a simulator, and
an inference engine as a plugin of Takt's policy host, such as TensorRT or C++
of your own.
.
Examples are in /usr/share/doc/takt-dev/examples.")
# The same files as in the wheel, with the library of `takt`.
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11), python3-numpy, takt (= ${takt_version}-1)")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-msgpack, python3-pandas, python3-websockets, python3-zmq, python3-zstandard")
set(CPACK_DEBIAN_PYTHON_DESCRIPTION
"policies in Python for Takt
Takt runs learned policies on robots in real time. With this package a policy
is a Python program: it reads observations as numpy arrays and answers them
with chunks of joint targets, which the executive judges as it judges any
other policy's.")
# Apart, for its dependency is libtorch. Where that was there to build it with.
if(TARGET takt-engine-torchscript)
  install(FILES ${share}/doc/changelog.Debian.gz ${share}/doc/changelog.gz ${package_files}/copyright
          DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/takt-engine-torchscript COMPONENT torchscript)
  list(APPEND CPACK_COMPONENTS_ALL torchscript)
  set(CPACK_DEBIAN_TORCHSCRIPT_PACKAGE_NAME takt-engine-torchscript)
  set(CPACK_DEBIAN_TORCHSCRIPT_PACKAGE_SECTION misc)
  set(CPACK_DEBIAN_TORCHSCRIPT_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_TORCHSCRIPT_PACKAGE_DEPENDS "takt (= ${takt_version}-1)")
  # libtorch takes whichever BLAS is there; the reference one, which most machines have, is ten times slower.
  set(CPACK_DEBIAN_TORCHSCRIPT_PACKAGE_RECOMMENDS "libopenblas0-pthread | libopenblas0 | libblis4-pthread")
  set(CPACK_DEBIAN_TORCHSCRIPT_DESCRIPTION
"TorchScript policies for Takt
Takt runs learned policies on robots in real time. This package is the engine
of its policy host for policies in TorchScript, by libtorch.")
endif()
include(CPack)
