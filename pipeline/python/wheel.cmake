# Packs the Python module as a wheel: its files, and what it says of itself (PEP 427); python3-wheel writes the record.
file(REMOVE_RECURSE ${FOLDER})
set(about ${FOLDER}/tree/emmetrope-${VERSION}.dist-info)
file(COPY ${SOURCES} DESTINATION ${FOLDER}/tree)
file(REMOVE_RECURSE ${FOLDER}/tree/emmetrope/__pycache__)
file(COPY ${MODULE} DESTINATION ${FOLDER}/tree/emmetrope)
file(COPY ${LICENCE} DESTINATION ${about})
execute_process(COMMAND ${PYTHON} -c "import sys, sysconfig; \
v = '%d%d' % sys.version_info[:2]; p = sysconfig.get_platform().replace('-', '_'); print(f'cp{v}-cp{v}-{p}')"
  OUTPUT_VARIABLE tag OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
file(WRITE ${about}/METADATA "Metadata-Version: 2.1
Name: emmetrope
Version: ${VERSION}
Summary: The optics of human eyes: rays, wavefronts, refractions, retinal images. For research use.
License: GPL-3.0-or-later
Requires-Dist: numpy
Provides-Extra: labels
Requires-Dist: xarray; extra == 'labels'
")
file(WRITE ${about}/WHEEL "Wheel-Version: 1.0
Generator: emmetrope
Root-Is-Purelib: false
Tag: ${tag}
")
execute_process(COMMAND ${PYTHON} -m wheel pack ${FOLDER}/tree --dest-dir ${FOLDER} COMMAND_ERROR_IS_FATAL ANY)
file(REMOVE_RECURSE ${FOLDER}/tree)
