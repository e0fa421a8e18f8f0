# Writes the bytes of INPUT as a zero-terminated C array VARIABLE into OUTPUT (run by emmetrope_embed).
file(READ ${INPUT} bytes HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
string(REGEX REPLACE "(0x[0-9a-f][0-9a-f],0x[0-9a-f][0-9a-f],0x[0-9a-f][0-9a-f],0x[0-9a-f][0-9a-f],0x[0-9a-f][0-9a-f],0x[0-9a-f][0-9a-f],0x[0-9a-f][0-9a-f],0x[0-9a-f][0-9a-f],)" "\\1\n" bytes "${bytes}")
file(WRITE ${OUTPUT} "namespace emmetrope {\nextern const char ${VARIABLE}[];\nextern const unsigned long ${VARIABLE}_size;\n#pragma GCC diagnostic ignored \"-Wnarrowing\"\nconst char ${VARIABLE}[] = {${bytes}0};\nconst unsigned long ${VARIABLE}_size = sizeof ${VARIABLE} - 1;\n}  // namespace emmetrope\n")
