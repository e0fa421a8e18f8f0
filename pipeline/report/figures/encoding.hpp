#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace emmetrope::report {

std::string base64(std::string_view bytes);
/// The bytes of a PNG file, scaled down where it is larger than a page has room for; empty for no file.
/// \throw Error (input_invalid) when the file is no picture
std::string page_png(const std::filesystem::path& file);
/// A picture file made small for a page.
struct PagePicture {
  std::string url;  ///< "data:image/jpeg;base64,..."
  int width_px = 0, height_px = 0;
};
/// \throw Error (input_invalid) when the file is no picture
PagePicture page_picture(const std::filesystem::path& file);

/// "data:image/png;base64,..."
std::string png_url(std::string_view png);
/// Text made safe between tags and in attributes of HTML and SVG; control characters become spaces, invalid
/// UTF-8 U+FFFD.
std::string escape_xml(const std::string& text);

}  // namespace emmetrope::report
