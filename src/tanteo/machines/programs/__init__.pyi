from .job import SURE as SURE
from .job import Job as Job
from .job import job_of as job_of
from .table import PROGRAMS as PROGRAMS
from .table import ProgramLanguage as ProgramLanguage
from .table import program_language as program_language
from .table import write_program as write_program
