# cmake -DLIBRARIES=a.a;b.a -DOUT=code_hash.cpp -P code_hash.cmake
set(all "")
foreach(library IN LISTS LIBRARIES)
  file(SHA256 ${library} hash)
  string(APPEND all ${hash})
endforeach()
string(SHA256 hash "${all}")
string(SUBSTRING ${hash} 0 16 hash)
file(WRITE ${OUT}
"#include \"simplify/bake/code_hash.hpp\"

namespace throng::simplify {
const char* const kBakeCode = \"${hash}\";
}
")
