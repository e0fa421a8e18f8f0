// make-fixture-case FOLDER [refused]: a case to look at the report by hand
#include <string>

#include "tests/support/fixture_case.hpp"

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  emmetrope::test::FixtureOptions options;
  options.refused = argc > 2 && std::string(argv[2]) == "refused";
  emmetrope::test::make_fixture_case(argv[1], options);
  return 0;
}
