#pragma once
#include <string_view>

namespace emmetrope {

inline bool ends_with(std::string_view text, std::string_view ending) {
  return text.size() >= ending.size() && text.substr(text.size() - ending.size()) == ending;
}

}  // namespace emmetrope
