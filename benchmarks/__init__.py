import ast
import sys
from pathlib import Path

# `python -m benchmarks.<name> --help`: what the module says of itself. While a package is imported for `-m`, argv[0] is
# that
if sys.argv[0] == "-m" and {"-h", "--help"} & set(sys.argv[1:]):
    name = sys.orig_argv[sys.orig_argv.index("-m") + 1].rpartition(".")[2]
    print(ast.get_docstring(ast.parse((Path(__file__).parent / f"{name}.py").read_text())))
    sys.exit()
