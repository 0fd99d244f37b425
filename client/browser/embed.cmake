# cmake -DFOLDER=... -DFILES="a;b" -DOUTPUT=page.cpp -P embed.cmake: files as arrays of bytes.
set(arrays "")
set(entries "")
set(count 0)
foreach(name IN LISTS FILES)
  file(READ ${FOLDER}/${name} hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(APPEND arrays "const unsigned char kFile${count}[] = {${bytes}0};\n")
  string(APPEND entries "    {\"${name}\", {reinterpret_cast<const char*>(kFile${count}), sizeof kFile${count} - 1}},\n")
  math(EXPR count "${count} + 1")
endforeach()
file(WRITE ${OUTPUT} "// Made by client/browser/embed.cmake.
#include \"server/web/page.hpp\"

namespace throng::server {
namespace {
${arrays}
const PageFile kFiles[] = {
${entries}};
}  // namespace

PageFile built_in_page(std::string_view name) {
  for (const PageFile& file : kFiles) {
    if (file.name == name) return file;
  }
  return {};
}
}  // namespace throng::server
")
