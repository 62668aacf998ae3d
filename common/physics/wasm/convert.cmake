# Converts a wasm module to C: cmake -DNODE= -DWASM2C= -DWASM= -DNAME= -DPARTS= -DFOLDER= -P convert.cmake
file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
execute_process(COMMAND ${NODE} ${WASM2C} -n ${NAME} --num-outputs ${PARTS} ${WASM} -o ${FOLDER}/${NAME}.c
                COMMAND_ERROR_IS_FATAL ANY)
# The generator forces each load to happen, for hosts that find out by a page fault. Here bounds are checked before the
# load, and a moving of every float through an integer register would be lost time.
file(READ ${FOLDER}/${NAME}-impl.h code)
string(REGEX REPLACE "#define (FORCE_READ_INT|FORCE_READ_FLOAT|SIMD_FORCE_READ)\\(var\\) __asm__[^\n]*"
                     "#define \\1(var)" code "${code}")
file(WRITE ${FOLDER}/${NAME}-impl.h "${code}")
