#pragma once
#include <map>
#include <string>

#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope::testing_eye {

/// The mesh by VTK's own writer, in every way in which a VTP file keeps its arrays: text, base64, appended; packed or not;
/// both byte orders, short and long headers. By what it is; all but "raw" say LPS.
std::map<std::string, std::string> vtp_files(const TriangleMesh& mesh);

}  // namespace emmetrope::testing_eye
